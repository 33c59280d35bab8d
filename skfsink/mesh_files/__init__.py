"""Readers of mesh files, one module a format; :func:`.mesh_file.read_mesh_file` is the entrance."""
