"""Pictures of plans: their pixels, how they stand, and what their files state of scale and place."""
