"""Effects that a rig can have and the plain model lacks.

In: the table ``[effects]`` of a scene. Out: each effect's parameters, and the law that it follows in the rig: of the
contract's list, of the literature, or a smooth random function.
"""
