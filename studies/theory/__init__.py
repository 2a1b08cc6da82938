"""What physics predicts, beside what is measured in runs."""
