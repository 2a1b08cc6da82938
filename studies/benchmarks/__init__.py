"""What learners reach on maps that they never saw, and what a step, a start and a run cost."""
