"""What a certificate says: parsed once into types, in the user's coordinates, exact and on the safe side.

Nothing here is trusted or proves anything: the checker does that, with code of its own. What is stated of a verified
certificate holds.
"""
