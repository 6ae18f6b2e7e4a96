"""Builds and checks the ONNX models that camssf ships."""
