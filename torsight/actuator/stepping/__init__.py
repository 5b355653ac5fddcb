"""The stepping rule: temperatures (°C), scalars and tables (SI) in, θ^A (rad), ξ and torques (N·m) out; compiled."""
