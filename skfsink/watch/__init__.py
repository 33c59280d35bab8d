"""The page about runs that go on: it refreshes itself, and only reads their files."""
