"""What a recording, or a campaign of them, says about how a pendulum loses energy."""
