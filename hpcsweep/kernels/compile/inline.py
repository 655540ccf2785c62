"""Inline kernels into others: typed and lowered once, optimised only where they are used.

numba compiles a called function on its own, to machine code, and then optimises and compiles it
again inside its caller, and inside the caller's caller. Here a called kernel is only lowered to
LLVM's intermediate form; optimisation and code generation happen once for each kernel that is
called from Python or through its address (`entry_points`), over all of its parts. Where that took
82 s of processor time and 371 MB, it took 214 s and 861 MB without this module. It derives from
private classes of numba, which is the reason for the upper bound on numba's version.
"""

import gc
from functools import cached_property
from typing import Any

from llvmlite import binding, ir
from llvmlite.binding import Linkage
from numba.core import compiler, typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher

from hpcsweep.kernels.compile import specialise


class _InlineLibrary(JITCodeLibrary):
    """Library to be linked into others: neither optimised nor passed to the execution engine."""

    def finalize(self):
        """Make the functions definable in every module that uses them."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"
        self._finalized = True

    def link_into(self, module):
        """Link only the functions of this library into an LLVM module."""
        module.link_in(self._final_module, preserve=True)

    def _get_module_for_linking(self):
        """Return the functions with all their callees, for numba's own libraries."""
        if self._shared_module is None:
            whole = self._final_module.clone()
            for library in _all_that_is_called(self):
                if isinstance(library, _InlineLibrary):
                    library.link_into(whole)
                else:
                    whole.link_in(library._get_module_for_linking(), preserve=True)
            self._shared_module = whole
        return self._shared_module


class _WholeLibrary(JITCodeLibrary):
    """Library with all its parts, recursively; no other is linked with it."""

    def _optimize_functions(self, ll_module):
        """Leave the function as it is until its parts are linked, and all are optimised at once.

        To optimise it alone before that would be a tenth of the processor time of a cold compile.
        """
        ll_module.data_layout = self._codegen._data_layout

    def finalize(self):
        """Link, optimise and generate code."""
        gc.collect()  # what typing and lowering leave in circles
        called = _all_that_is_called(self)
        for library in called:
            if isinstance(library, _InlineLibrary):
                library.link_into(self._final_module)
        specialise.define_words(self._final_module)
        specialise.rename_addresses(self._final_module)
        self._linking_libraries = [
            library for library in called if not isinstance(library, _InlineLibrary)
        ]
        super().finalize()

    def _optimize_final_module(self):
        """Optimise, then keep the parts that are left as functions to this kernel alone.

        Loops over lengths that are not known have few turns: as numba has them unrolled and
        vectorised, code and LLVM's time are twice as large, and motions take a tenth longer.
        As functions that any module may define (``linkonce_odr``) the first copy that a process
        loads would serve all kernels: one whose calls lead to kernels of other sizes.
        """
        passes, builder = self._codegen._module_pass_manager(opt=0, cost="cheap")
        passes.run(self._final_module, builder)
        tuning = binding.create_pipeline_tuning_options(speed_level=3)
        tuning.loop_vectorization = tuning.loop_unrolling = specialise.current is not None
        tuning.slp_vectorization = True
        builder = binding.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"

    def _get_module_for_linking(self):
        """Return only the names, which numba needs when it loads the machine code.

        The functions themselves would be stored beside their machine code, and parsed again at
        every load.
        """
        names = ir.Module(self.name)
        nothing = ir.FunctionType(ir.VoidType(), ())
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage != Linkage.internal:
                entry = ir.Function(names, nothing, function.name).append_basic_block()
                ir.IRBuilder(entry).ret_void()
        return binding.parse_assembly(str(names))


def _all_that_is_called(library):
    """Return the libraries that one calls, and those that its parts call, callers first.

    LLVM leaves a part out that nothing linked before asks for: a library that lists a part whose
    call has been optimised away must not bring it in before another one that does call it.
    """
    done, order = set(), []

    def follow(part) -> None:
        done.add(part)
        if part is library or isinstance(part, _InlineLibrary):
            for called in part._linking_libraries:
                if called not in done:
                    follow(called)
        order.append(part)

    follow(library)
    return order[-2::-1]


@register_pass(mutates_CFG=False, analysis_only=False)
class _LowerInline(typed_passes.NativeLowering):
    _name = "hpcsweep_lower_part"

    def run_pass(self, state):
        """Lower into a library that is not compiled, and register it for callers."""
        state.library = _InlineLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        state.library.finalize()
        entry = _Entry()
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _LowerWhole(typed_passes.NativeLowering):
    _name = "hpcsweep_lower_whole"

    def run_pass(self, state):
        """Lower into a library that gathers the parts of its parts."""
        state.library = _WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


class _Entry:
    """Placeholder for a compiled part where numba looks a function up."""


PASSES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.AnnotateTypes,
)
"""Passes of numba before lowering.

Those left out, a fifth of the processor time of a cold compile, are for what kernels do without:
closures and comprehensions, expressions of whole arrays, literals, objects in exceptions.
"""


def _pipeline(lowering):
    class Pipeline(compiler.CompilerBase):
        def define_pipelines(self):
            made = PassManager("kernels")
            for each in (*PASSES, lowering, typed_passes.NoPythonBackend):
                made.add_pass(each, each.name())
            made.finalize()
            return [made]

    return Pipeline


_PART, _WHOLE = _pipeline(_LowerInline), _pipeline(_LowerWhole)


class _InlineDispatcher(CPUDispatcher):
    """Compiler of a kernel for its callers; Python cannot call it."""

    def add_overload(self, cres):
        """Keep a compile result, without the types of its variables and calls.

        With them, and with the circles that are collected before a whole is optimised, the largest
        process of a cold compile takes 390 MB in place of 317.
        """
        cres.fndesc.typemap = cres.fndesc.calltypes = None
        self.overloads[tuple(cres.signature.args)] = cres._replace(type_annotation=None)


class KernelDispatcher(CPUDispatcher):
    """Compiler of a kernel for calls from Python; kernels that call it inline it.

    Parameters
    ----------
    function : callable
    options : dict
    cache : KernelCache, optional
        Keeps what is compiled.
    """

    def __init__(self, function, options, cache=None):
        # no kernel is called through a C pointer
        options = {"nopython": True, "boundscheck": None, "no_cfunc_wrapper": True, **options}
        super().__init__(function, targetoptions=options, pipeline_class=_WHOLE)
        if cache is not None:
            self._cache = cache

    @cached_property
    def _part(self) -> Any:
        options = self.targetoptions | {"no_cpython_wrapper": True}
        return _InlineDispatcher(self.py_func, targetoptions=options, pipeline_class=_PART)

    def get_call_template(self, args, kws):
        """Return the signature of a call by a kernel; a part is not typed anew for constants."""
        return self._part.get_call_template(tuple(map(types.unliteral, args)), kws)

    def get_overload(self, sig):
        """Return the function that a kernel calls."""
        return self._part.get_overload(sig)
