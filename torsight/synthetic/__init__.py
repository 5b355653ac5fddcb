"""A rig with its own integrator and a camera that films it: experiments with known answers."""
