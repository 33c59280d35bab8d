"""Several ranks of MPI on one body: its parts, what they tell each other, and who leads them."""
