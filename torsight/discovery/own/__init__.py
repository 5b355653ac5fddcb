"""Discovery on a model of one's own: from a function, a table and a list of parameters to findings.

``model_problem`` puts a model before the engine, ``find_missing`` asks what it lacks, ``ode`` makes a model from
differential equations.
"""
