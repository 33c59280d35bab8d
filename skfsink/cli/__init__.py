"""The program and its commands, a module each with a function of the same name."""
