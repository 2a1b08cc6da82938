"""What stages are made of: the types of parts, columns and stages, and the plan of a step."""
