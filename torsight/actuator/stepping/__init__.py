"""The stepping rule: from temperatures (°C), scalars and tables (SI) to θ^A (rad), ξ and torques (N·m); compiled."""
