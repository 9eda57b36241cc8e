"""What happens to a site, told to those who listen.

`difference` finds what lies between two published views, `recorder` does so for every site and
keeps it, `feed` reads it out to one listener, `stream` is its HTTP face. A listener has a place in
the history and no queue: a slow one costs nothing, and one that comes back goes on from its place.
"""
