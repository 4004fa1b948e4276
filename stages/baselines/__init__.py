"""What the two networks are compared with: matchers of whole pairs, and confidence measures of the same raw maps."""
