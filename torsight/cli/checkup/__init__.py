"""What ``torsight doctor`` looks at: film, log, actuator and what they allow together, each as findings."""
