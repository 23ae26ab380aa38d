"""CVODE without a Python call per evaluation: the libraries that scikit-sundae ships.

scikit-sundae's own interface takes 3 µs per evaluation to wrap arrays, most of
what such a small system costs. Here the equations are compiled to C functions and
CVODE is called by ctypes. Handles are integers, so that compiled code takes them.
"""

import ctypes
import importlib.metadata
from ctypes import c_double, c_int, c_int64, c_long, c_void_p

import numpy as np
from numba import carray, cfunc, types

import equations
from equations import compliant_into, compliant_jacobian, rolling_into

ADAMS, BDF = 1, 2
NORMAL = 1
MOST_STEPS = 100_000_000


def _library(name):
    files = importlib.metadata.files("scikit-sundae")
    found = [file for file in files if file.name.startswith(f"libsundials_{name}")]
    if not found:
        raise RuntimeError(f"this wheel of scikit-sundae has no libsundials_{name}")
    return ctypes.CDLL(str(found[0].locate()))


def _declare(library, name, result, *arguments):
    function = getattr(library, name)
    function.restype, function.argtypes = result, arguments
    return function


_core, _vector, _cvode = _library("core"), _library("nvecserial"), _library("cvode")
_dense, _solver = _library("sunmatrixdense"), _library("sunlinsoldense")
_numbers = ctypes.POINTER(c_double)
_context_create = _declare(_core, "SUNContext_Create", c_int, c_int, c_void_p)
_vector_make = _declare(_vector, "N_VMake_Serial", c_int64, c_int64, c_void_p, c_int64)
_vector_data = _declare(_vector, "N_VGetArrayPointer_Serial", _numbers, c_void_p)
_matrix_make = _declare(_dense, "SUNDenseMatrix", c_int64, c_int64, c_int64, c_int64)
_matrix_data = _declare(_dense, "SUNDenseMatrix_Data", _numbers, c_void_p)
_solver_make = _declare(_solver, "SUNLinSol_Dense", c_int64, c_int64, c_int64, c_int64)
_fixed_point = _declare(_cvode, "SUNNonlinSol_FixedPoint", c_int64, c_int64, c_int, c_int64)
_create = _declare(_cvode, "CVodeCreate", c_int64, c_int, c_int64)
_init = _declare(_cvode, "CVodeInit", c_int, c_int64, c_void_p, c_double, c_int64)
_tolerances = _declare(_cvode, "CVodeSStolerances", c_int, c_int64, c_double, c_double)
_set_linear = _declare(_cvode, "CVodeSetLinearSolver", c_int, c_int64, c_int64, c_int64)
_set_nonlinear = _declare(_cvode, "CVodeSetNonlinearSolver", c_int, c_int64, c_int64)
_set_jacobian = _declare(_cvode, "CVodeSetJacFn", c_int, c_int64, c_void_p)
_set_user = _declare(_cvode, "CVodeSetUserData", c_int, c_int64, c_void_p)
_set_most_steps = _declare(_cvode, "CVodeSetMaxNumSteps", c_int, c_int64, c_long)
_set_longest = _declare(_cvode, "CVodeSetMaxStep", c_int, c_int64, c_double)
reinit = _declare(_cvode, "CVodeReInit", c_int, c_int64, c_double, c_int64)
set_stop = _declare(_cvode, "CVodeSetStopTime", c_int, c_int64, c_double)
solve = _declare(_cvode, "CVode", c_int, c_int64, c_double, c_int64, c_int64, c_int)

_RHS = types.int32(types.float64, *[types.voidptr] * 3)
_JACOBIAN = types.int32(types.float64, *[types.voidptr] * 7)


@cfunc(_RHS)
def _compliant(t, y, out, user):
    scene = carray(user, 3, np.float64)
    compliant_into(t, carray(_vector_data(y), 9),
                        carray(_vector_data(out), 9),
                        int(scene[0]), scene[1], scene[2])
    return 0


@cfunc(_RHS)
def _rolling(t, y, out, user):
    scene = carray(user, 3, np.float64)
    rolling_into(t, carray(_vector_data(y), 5),
                      carray(_vector_data(out), 5), int(scene[0]))
    return 0


@cfunc(_JACOBIAN)
def _compliant_jacobian(t, y, _rate, matrix, user, _1, _2, _3):
    scene = carray(user, 3, np.float64)
    state = carray(_vector_data(y), 9)
    # The library keeps columns, hence the transpose.
    transposed = carray(_matrix_data(matrix), (9, 9))
    transposed[:] = compliant_jacobian(t, state, int(scene[0]), scene[1], scene[2]).T
    return 0


class Cvode:
    """CVODE on one model; `y` is its state, `memory` and `vector` its handles."""

    def __init__(self, scene, model, tolerance, absolute, longest=0.0):
        stiff = model == "compliant"
        self.start = equations.START if stiff else equations.ROLLING_START
        self.y = self.start.copy()
        self.user = np.array(scene.arguments, dtype=float)
        context = c_int64()
        _context_create(0, ctypes.addressof(context))
        self.vector = _vector_make(len(self.y), self.y.ctypes.data, context)
        self.memory = _create(BDF if stiff else ADAMS, context)
        function = _compliant if stiff else _rolling
        _init(self.memory, function.address, 0.0, self.vector)
        _tolerances(self.memory, tolerance, absolute)
        _set_user(self.memory, self.user.ctypes.data)
        _set_most_steps(self.memory, MOST_STEPS)
        _set_longest(self.memory, longest)
        (self._newton if stiff else self._functional)(context)

    def _newton(self, context):
        matrix = _matrix_make(len(self.y), len(self.y), context)
        _set_linear(self.memory, _solver_make(self.vector, matrix, context), matrix)
        _set_jacobian(self.memory, _compliant_jacobian.address)

    def _functional(self, context):
        _set_nonlinear(self.memory, _fixed_point(self.vector, 0, context))
