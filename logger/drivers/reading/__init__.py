"""Values, rows and identities in the text of a reply, for the drivers of all vendors."""
