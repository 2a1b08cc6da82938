"""Results of published papers, each reproduced by a model of the gallery."""
