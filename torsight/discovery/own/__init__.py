"""Discovery on a model of one's own: from a function, a table and a list of parameters to findings.

``model_problem`` makes the engine's problem from a model, ``find_missing`` searches for what the model lacks, ``ode``
makes a model from differential equations.
"""
