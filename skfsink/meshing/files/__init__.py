"""Reading, mending and converting of mesh files."""
