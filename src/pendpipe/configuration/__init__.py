"""The typed configuration of a campaign."""
