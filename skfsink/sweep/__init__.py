"""Many runs of one scene: which parameters vary, their folders, who runs them, the table and the picture at the end."""
