"""Any MJCF robot in any world."""
