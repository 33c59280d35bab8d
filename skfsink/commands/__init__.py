"""Commands of the program, a module each with a function of the same name."""
