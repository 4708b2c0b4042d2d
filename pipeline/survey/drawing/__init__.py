"""Pictures of plans: how they stand, what they show, and their scale."""
