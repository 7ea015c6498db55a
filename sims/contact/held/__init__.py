"""Contact of a pad with objects of any form."""
