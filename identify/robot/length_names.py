"""What a length may be called: a name that no printed model and no language it is printed in has another use for."""

from __future__ import annotations

import keyword
import re

C_WORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    alignas alignof bool constexpr false nullptr static_assert thread_local true typeof typeof_unqual asm main
    out NULL NAN INFINITY HUGE_VAL HUGE_VALF HUGE_VALL FLT_EVAL_METHOD MATH_ERRNO MATH_ERREXCEPT
    math_errhandling float_t double_t signgam math
"""
"""Keywords of C up to C23, names of math.h that are no functions, and what printed functions call their own."""

C_FUNCTIONS = """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor
    fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb lrint lround modf
    nan nearbyint nextafter nexttoward pow remainder remquo rint round scalbln scalbn sin sinh sqrt tan tanh
    tgamma trunc
"""
"""Functions of math.h; each has one for float and for long double too, with f and l behind its name."""

OTHER_FUNCTIONS = """
    fpclassify isfinite isinf isnan isnormal signbit isgreater isgreaterequal isless islessequal islessgreater
    isunordered j0 j1 jn y0 y1 yn gamma abs int float max min sum pow pi E I N O S Q sign beta zeta
"""
"""Macros of math.h, functions that compilers and Python know unasked, and names that sympy reads as its own."""

MODELS = """
    jacobian lagrange energy direct_geometry inverse_geometry inverse_kinematics base_parameters newton_euler
    direct_dynamics q dq ddq tau tau_f tau_e A C Cc D F H J K U h phi theta psi roll pitch yaw turn lever
"""
"""Functions of printed models, their arguments and their results."""

VARIABLES = re.compile(
    r"""
      (?: d{0,2}q | tau(?:_[efj])? | sign | turn | lever ) \d+ (?:_\d+)?     # signals
    | (?: q | e | C | S | B[a-c]? | W | X | Y | Z | Q | QCC | QCS | QC | QS ) \d+ (?:[_m]+\d+)*  # geometry: C23, C2m3
    | (?: A | Cc | J | K | L ) \d+ _? \d+                                    # entries of matrices: A11, A1_12
    | (?: H | b | d | k | t ) \d+                                            # elimination, intermediate values
    | (?: U | V | Vp | w | wp | f | m ) \d+ (?:_?\d+)?                       # of the recurrence: w2_1
    | (?: [XYZ]{2} | S[XYZ]{2} | M[XYZ]? | Ia | Fv | Fs | off ) [Rm]? \d+    # parameters
    | r (?: S[XYZ]{2} | M[XYZ]? | Ia ) \d+ | PHI\d+ | [CS]P\d+ | \w*\d[ui]   # of bodies, turns, units
    | [FNG] \d+ | h_\w+ | [sna][xyz] | P[xyz] | Q[1-4] | M_\w+ | FP_\w+
    """,
    re.VERBOSE,
)
"""Names of the form of the printed models' own variables."""


def length_name_problem(name: str) -> str | None:
    """Why a length of a robot can't have this name, None if it can."""
    if not re.fullmatch(r"[A-Za-z]\w*", name, flags=re.ASCII):
        return "use letters and digits, as in D3"
    if keyword.iskeyword(name) or name in C_WORDS.split():
        return "it is a word of C or Python; choose another, as in D3"
    functions = C_FUNCTIONS.split()
    if name in functions or name in OTHER_FUNCTIONS.split() or (name[-1] in "fl" and name[:-1] in functions):
        return "C, Python or sympy knows it as something else; choose another, as in D3"
    if name in MODELS.split() or VARIABLES.fullmatch(name.rstrip("_")):
        return "printed models use it for a variable of theirs; choose another, as in D3"
    return None
