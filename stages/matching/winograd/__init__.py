"""The matching-Net in Winograd-transformed convolutions: the same results in a third of the time."""
