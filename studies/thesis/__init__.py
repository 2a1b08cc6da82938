"""The results of the thesis that a computer can make, made again, each with a verdict; and all that it contains."""
