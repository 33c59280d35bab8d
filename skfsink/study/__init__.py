"""Studies of the methods: speed against accuracy, stability, and how much model a scene needs."""
