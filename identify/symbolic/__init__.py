"""The models of Khalil & Dombre, "Modélisation des robots de type série", exact: knows no numbers.

Theirs is the chapter that docstrings speak of, and [2.93] the number of one of its equations, here and in other rooms.
"""
