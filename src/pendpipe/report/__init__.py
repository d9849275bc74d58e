"""The page about a campaign."""
