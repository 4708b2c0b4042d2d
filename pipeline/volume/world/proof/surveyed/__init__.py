"""How a volume is measured against its survey: walls and widths along legs."""
