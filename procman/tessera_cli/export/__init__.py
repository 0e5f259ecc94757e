"""`tessera export`: runs in the formats of other programs."""
