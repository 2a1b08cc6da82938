class ShapelyEngine: pass
