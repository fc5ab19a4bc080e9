"""A path tracer for Mitsuba 3 that regularises next-event estimation with the tables of opsr.

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")           # or scalar_rgb
    import opsr.mitsuba
    opsr.mitsuba.register()
    scene = mi.load_dict({..., "integrator": {"type": "opsr", "table": "beta-0.001"}})

Parameters of the integrator: `table` (a file, "beta-0.001" or "beta-0.05") or `gamma` (one factor from 0 to 1); neither is
plain path tracing. `max_depth`, `rr_depth` and `hide_emitters` as of Mitsuba's `path`.

Lobes are evaluated by Mitsuba's own plugins: next to every rough or smooth conductor and dielectric stands a twin whose
roughness is a texture of the surface coordinates, and those are set to the roughness that is wanted. Other plugins with a
glossy lobe are refused by name; diffuse ones stay as they are. Words and numbers are those of docs/method.md and
docs/renderers.md.
"""

import drjit as dr
import mitsuba as mi

from . import Table

_VARIANT = mi.variant()
if _VARIANT is None:
    raise ImportError("opsr.mitsuba: choose a variant of Mitsuba first, such as mi.set_variant('llvm_ad_rgb')")

_EDGES = (0.0691871, 0.2356392, 0.4597815)  # of the bins of roughness, docs/method.md section 1
_OFFSETS = (0, 16, 80, 336)  # of the classes of 2, 3, 4 and 5 vertices
_DIRAC = 1e-3  # a sharper lobe is a Dirac lobe


def _bin(alpha):
    """Bin of a roughness."""
    one = lambda edge: dr.select(alpha >= edge, mi.UInt32(1), mi.UInt32(0))
    return one(_EDGES[0]) + one(_EDGES[1]) + one(_EDGES[2])


def _at_most(x, bound):
    """The less of both. LLVM has no code for Dr.Jit's minimum on some processors."""
    return dr.select(x < bound, x, mi.Float(bound))


class PathRoughness:
    """Roughness of the vertices before the last one, camera first: at most four values. The others are zero."""

    DRJIT_STRUCT = {"a": mi.Float, "b": mi.Float, "c": mi.Float, "d": mi.Float, "code": mi.UInt32, "length": mi.UInt32}

    def __init__(self):
        self.a, self.b, self.c, self.d = mi.Float(0), mi.Float(0), mi.Float(0), mi.Float(0)
        self.code, self.length = mi.UInt32(0), mi.UInt32(0)

    def accumulate(self, alpha, gammas):
        """Accumulated roughness of a last vertex of this roughness, docs/method.md section 2."""
        n = self.length
        offset = dr.select(n <= 1, _OFFSETS[0], dr.select(n == 2, _OFFSETS[1], dr.select(n == 3, _OFFSETS[2], _OFFSETS[3])))
        gamma = gammas(mi.UInt32(offset) + self.code * 4 + _bin(alpha))
        q = mi.Float(0)
        for before in (self.a, self.b, self.c, self.d):
            q += gamma * before * (1 - q)
        accumulated = _at_most(alpha + (1 - alpha) * q, 1)
        return dr.select((n == 0) | (alpha >= 1), alpha, accumulated)

    def pushed(self, alpha, gammas, active):
        """With one more vertex where `active`; the fifth folds all five into one."""
        full = self.length == 4
        alpha = dr.select(full, self.accumulate(alpha, gammas), alpha)
        n = dr.select(full, mi.UInt32(0), self.length)
        code = dr.select(full, mi.UInt32(0), self.code)
        kept = lambda value, k: dr.select(active, dr.select(n == k, alpha, dr.select(full, 0, value)), value)
        path = PathRoughness()
        path.a, path.b, path.c, path.d = kept(self.a, 0), kept(self.b, 1), kept(self.c, 2), kept(self.d, 3)
        path.code = dr.select(active, code * 4 + _bin(alpha), self.code)
        path.length = dr.select(active, n + 1, self.length)
        return path


class _Factors:
    """Factors by class."""

    def __init__(self, table, gamma):
        if table is None:
            self.table = [gamma] * 1360
        else:
            table = Table.load(table)
            if table.interpolation != "nearest":
                raise ValueError(f"opsr: a table with the look-up `{table.interpolation}`; only `nearest` is known here")
            self.table = (table.gammas * table.scale).clip(0, 1).tolist()
        if dr.is_jit_v(mi.Float):
            self.table = mi.Float(self.table)
            dr.eval(self.table)

    def __call__(self, index):
        if dr.is_jit_v(mi.Float):
            return dr.gather(mi.Float, self.table, dr.select(index < 1360, index, 0))
        return self.table[index]


def _value(parameters, name, default):
    """A parameter that does not vary over the surface, as an entry of a dictionary."""
    if name + ".data" in parameters:
        raise ValueError(f"opsr: a texture for `{name}`, and only constants are known here")
    if name + ".value" not in parameters:
        return default
    value = parameters[name + ".value"]
    channels = [float(x if isinstance(x, float) else x[0]) for x in (value if dr.size_v(value) == 3 else [value])]
    return {"type": "rgb", "value": channels} if len(channels) == 3 else channels[0]


def _twin(bsdf):
    """Roughness of a BSDF, and one that is evaluated at any roughness: see `_at`. None for a BSDF to leave as it is."""
    kind, parameters = bsdf.class_name(), mi.traverse(bsdf)
    if kind in ("RoughConductor", "SmoothConductor", "RoughDielectric", "SmoothDielectric"):
        names = [key for key, *_ in parameters]
        if "alpha_u.value" in names or any(key.startswith("alpha") and not key.endswith(".value") for key in names):
            raise ValueError("opsr: a roughness that is not one number")
        smooth = kind.startswith("Smooth")
        alpha = 0.0 if smooth else _value(parameters, "alpha", None)
        description = str(bsdf)
        # A ramp that is linear between the centres of its texels, at 1/4 and 3/4.
        ramp = mi.TensorXf([0.0, 1.0], (1, 2, 1))
        twin = {
            "type": "roughconductor" if "Conductor" in kind else "roughdielectric",
            "distribution": "ggx" if "distribution = ggx" in description else "beckmann",
            "alpha": {"type": "bitmap", "data": ramp, "raw": True, "wrap_mode": "clamp", "format": "variant"},
            "specular_reflectance": _value(parameters, "specular_reflectance", 1.0),
        }
        if "Conductor" in kind:
            twin.update(eta=_value(parameters, "eta", 0.0), k=_value(parameters, "k", 1.0))
        else:
            eta = parameters["eta"]
            twin.update(int_ior=float(eta if isinstance(eta, float) else eta[0]), ext_ior=1.0)
            twin["specular_transmittance"] = _value(parameters, "specular_transmittance", 1.0)
        return alpha, mi.load_dict(twin)
    if not any(mi.has_flag(bsdf.flags(), flag) for flag in (mi.BSDFFlags.Glossy, mi.BSDFFlags.Delta)):
        return 1.0, None
    raise ValueError(f"opsr: a BSDF `{kind}`; known are conductors, dielectrics and what is diffuse")


class _Twins:
    """Roughness and twins of all BSDFs of a scene."""

    def __init__(self, scene):
        self.scene = scene
        bsdfs = []
        for shape in scene.shapes():
            bsdf = shape.bsdf()
            if bsdf is not None and all(bsdf is not other for other in bsdfs):
                bsdfs.append(bsdf)
        self.known = [(bsdf, *_twin(bsdf)) for bsdf in bsdfs]
        if not dr.is_jit_v(mi.Float):
            return
        number = lambda bsdf: int(dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(bsdf))[0])
        rows = [(number(bsdf), alpha, number(twin) if twin is not None else 0) for bsdf, alpha, twin in self.known]
        alphas, twins = [1.0] * (max(rows)[0] + 1), [0] * (max(rows)[0] + 1)
        for own, alpha, twin in rows:
            alphas[own], twins[own] = alpha, twin
        self.alphas, self.twins = mi.Float(alphas), mi.UInt32(twins)
        dr.eval(self.alphas, self.twins)

    def of(self, bsdf):
        """Roughness and twin of a BSDF; True if it has one."""
        if dr.is_jit_v(mi.Float):
            own = dr.reinterpret_array(mi.UInt32, bsdf)
            twin = dr.gather(mi.UInt32, self.twins, own)
            return dr.gather(mi.Float, self.alphas, own), dr.reinterpret_array(mi.BSDFPtr, twin), twin != 0
        for other, alpha, twin in self.known:
            if other is bsdf:
                return alpha, twin, twin is not None
        return 1.0, None, False


def _balance(a, b):
    """Weight of a draw of density `a` beside one of density `b`."""
    return dr.select(a > 0, a / dr.select(a > 0, a + b, 1), 0)


class Path(mi.SamplingIntegrator):
    """The integrator: docs/method.md section 3."""

    def __init__(self, props):
        super().__init__(props)
        table, gamma = props.get("table", ""), props.get("gamma", -1.0)
        if table and gamma >= 0:
            raise ValueError("opsr: gamma: a table has factors of its own")
        if not table and gamma != -1 and not 0 <= gamma <= 1:
            raise ValueError("opsr: gamma: expected a number from 0 to 1")
        self.max_depth, self.rr_depth = props.get("max_depth", -1), props.get("rr_depth", 5)
        self.hide = props.get("hide_emitters", False)
        self.regularises = bool(table) or gamma > 0
        self.factors = _Factors(table or None, max(gamma, 0.0))
        self.twins = None

    def of_scene(self, scene):
        if self.twins is None or self.twins.scene is not scene:
            self.twins = _Twins(scene)
        return self.twins

    def render(self, scene, *args, **kwargs):
        # Plugins cannot be loaded on the threads of a scalar render.
        self.of_scene(scene)
        return super().render(scene, *args, **kwargs)

    def sample(self, scene, sampler, ray_, medium=None, active=True):
        twins, gammas = self.of_scene(scene), self.factors
        context, scalar = mi.BSDFContext(), not dr.is_jit_v(mi.Float)
        most = 0xFFFFFFFF if self.max_depth < 0 else self.max_depth

        # A scalar pointer may lead nowhere.
        def emitted(emitter, si, active):
            return mi.Spectrum(0) if scalar and not active else emitter.eval(si, active)

        def density_of(reference, found, active):
            return 0.0 if scalar and not active else scene.pdf_emitter_direction(reference, found, active)

        def vertex(active, sampler, ray, radiance, throughput, eta, depth, before, density, dirac, counts, valid, memory):
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=depth == 0, active=active)
            valid |= active & (depth == 0) & si.is_valid()

            # Emission met by the ray. `density` is that of its direction, `counts` is false for emission that a draw of
            # its own has counted.
            found = mi.DirectionSample3f(scene, si, before)
            emitter = si.emitter(scene)
            counted = active & counts & (emitter != None)
            other = density_of(before, found, counted & (dirac ^ True))
            weight = dr.select(dirac, 1, _balance(density, other))
            radiance += dr.select(counted, throughput * weight * emitted(emitter, si, counted), 0)
            active &= si.is_valid() & (depth + 1 < most)
            if scalar and not active:
                return active, sampler, ray, radiance, throughput, eta, depth, before, density, dirac, counts, valid, memory

            # The vertex, its roughness and that of next-event estimation.
            bsdf = si.bsdf(ray)
            alpha, twin, has_twin = twins.of(bsdf)
            roughness = memory.accumulate(alpha, gammas)
            roughened = active & has_twin & (roughness > alpha) & (roughness >= _DIRAC) & self.regularises
            # Where a twin reads its roughness.
            at = mi.SurfaceInteraction3f(si)
            at.uv = dr.select(roughened, mi.Point2f(0.25 + 0.5 * roughness, 0.5), si.uv)
            lobe = dr.select(roughened, twin, bsdf)

            # A light sample.
            lit = active & (roughened | mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth))
            light, incoming = scene.sample_emitter_direction(si, sampler.next_2d(), True, lit)
            lit &= light.pdf > 0
            value, pdf = lobe.eval_pdf(context, at, si.to_local(light.d), lit)
            weight = dr.select(light.delta, 1, _balance(light.pdf, pdf))
            radiance += dr.select(lit, throughput * value * incoming * weight, 0)

            # Emission that the roughened lobe finds, and the continuation, with the same random numbers.
            u, v = sampler.next_1d(), sampler.next_2d()
            if self.regularises and not (scalar and not roughened):
                drawn, factor = lobe.sample(context, at, u, v, roughened)
                reached = roughened & (drawn.pdf > 0)
                way = si.spawn_ray(si.to_world(drawn.wo))
                end = scene.ray_intersect(way, mi.RayFlags.All, coherent=False, active=reached)
                seen = mi.DirectionSample3f(scene, end, si)
                emitter = end.emitter(scene)
                reached &= emitter != None
                weight = _balance(drawn.pdf, density_of(si, seen, reached))
                radiance += dr.select(reached, throughput * factor * weight * emitted(emitter, end, reached), 0)

            drawn, factor = bsdf.sample(context, si, u, v, active)
            active &= drawn.pdf > 0
            dirac = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
            counts = roughened ^ True
            density, before = drawn.pdf, mi.Interaction3f(si)
            throughput = throughput * factor
            eta = eta * drawn.eta
            memory = memory.pushed(alpha, gammas, active)
            ray = si.spawn_ray(si.to_world(drawn.wo))
            depth = depth + 1

            # Russian roulette.
            largest = dr.max(throughput)
            active &= largest > 0
            survival = _at_most(largest * eta * eta, 0.95)
            plays = active & (depth >= self.rr_depth)
            survives = sampler.next_1d() < survival
            throughput = dr.select(plays & survives, throughput / dr.select(survival > 0, survival, 1), throughput)
            active &= (plays ^ True) | survives
            return active, sampler, ray, radiance, throughput, eta, depth, before, density, dirac, counts, valid, memory

        state = (
            mi.Bool(active), sampler, mi.Ray3f(ray_), mi.Spectrum(0), mi.Spectrum(1), mi.Float(1), mi.UInt32(0),
            dr.zeros(mi.Interaction3f), mi.Float(1), mi.Bool(True), mi.Bool(not self.hide), mi.Bool(False), PathRoughness(),
        )
        state = dr.while_loop(state, lambda active, *_: active, vertex)
        return state[3], state[11], []


def register():
    """Makes the plugin `opsr` known to Mitsuba."""
    if mi.variant() != _VARIANT:
        raise RuntimeError(f"opsr: this module belongs to the variant {_VARIANT}, with which it was imported")
    mi.register_integrator("opsr", lambda props: Path(props))
