"""Materials of Blender's shader nodes as those of glTF.

The exporter translates one Principled BSDF with its textures. What it leaves out is read here, as constants: other shaders,
mixtures of shaders, and the absorption inside of glass. A shader is read into a `look`: a dict of numbers as below.
"""

import math

PLAIN = {
    "color": (0.8, 0.8, 0.8),
    "metallic": 0.0,
    "roughness": 0.5,
    "ior": 1.5,
    "specular": 1.0,
    "transmission": 0.0,
    "alpha": 1.0,
    "emission": (0.0, 0.0, 0.0),
    "coat": 0.0,
    "coat_roughness": 0.03,
    "sheen": (0.0, 0.0, 0.0),
    "sheen_roughness": 0.5,
    # Share of the base that transmits diffusely, and the colour of that light.
    "translucent": 0.0,
    "through": (0.8, 0.8, 0.8),
}
BLACK = {**PLAIN, "color": (0.0, 0.0, 0.0), "specular": 0.0, "roughness": 1.0}
# Nodes between a socket and an image that the exporter sees through.
TEXTURED = {
    "TEX_IMAGE", "MAPPING", "UVMAP", "TEX_COORD", "SEPARATE_COLOR", "COMBINE_COLOR", "NORMAL_MAP", "VERTEX_COLOR", "MIX", "MIX_RGB",
    "MATH", "REROUTE", "GROUP", "ATTRIBUTE", "VALUE", "RGB", "VECT_MATH", "SEPRGB", "COMBRGB",
}  # fmt: skip


class Reader:
    """Reads the shaders of a material; `notes` says what is not translated."""

    def __init__(self, name):
        self.name, self.notes = name, []

    def note(self, what):
        line = f"material {self.name}: {what}"
        if line not in self.notes:
            self.notes.append(line)

    def number(self, node, *names):
        """The value of a socket; one that is linked counts as it is, or as a linked constant."""
        socket = next((node.inputs[name] for name in names if name in node.inputs), None)
        if socket is None:
            return None
        source = source_of(socket)
        value = socket.default_value
        if source is not None:
            if source.type in ("RGB", "VALUE"):
                value = source.outputs[0].default_value
            elif source.type == "BLACKBODY":
                value = blackbody(source.inputs[0].default_value)
            else:
                self.note(f"{socket.name} of {node.name} comes from {source.name} and is taken as constant")
                value = (0.8, 0.8, 0.8, 1.0) if hasattr(value, "__len__") else value
        return tuple(value)[:3] if hasattr(value, "__len__") else float(value)

    def look(self, node):
        """The look of a shader, or None for one that is not known."""
        if node is None:
            return None
        read = getattr(self, "of_" + node.type.lower(), None)
        if read is None:
            self.note(f"{node.name} is not translated")
            return None
        return read(node)

    def shader(self, node, place):
        return self.look(source_of(node.inputs[place]))

    def of_bsdf_principled(self, node):
        get = lambda *names: self.number(node, *names)
        strength, emission = get("Emission Strength") or 0.0, get("Emission Color", "Emission") or (0, 0, 0)
        sheen, tint = get("Sheen Weight") or 0.0, get("Sheen Tint") or (1, 1, 1)
        return {
            **PLAIN,
            "color": get("Base Color"),
            "metallic": get("Metallic"),
            "roughness": get("Roughness"),
            "ior": max(get("IOR"), 1.0),
            "specular": 1.0 if get("Specular IOR Level") is None else 2 * get("Specular IOR Level"),
            "transmission": get("Transmission Weight", "Transmission") or 0.0,
            "alpha": get("Alpha"),
            "emission": tuple(c * strength for c in emission),
            "coat": get("Coat Weight") or 0.0,
            "coat_roughness": get("Coat Roughness") or 0.0,
            "sheen": tuple(c * sheen for c in tint),
            "sheen_roughness": get("Sheen Roughness") or 0.5,
            "principled": True,
        }

    def of_bsdf_diffuse(self, node):
        return {**PLAIN, "color": self.number(node, "Color"), "roughness": 1.0, "specular": 0.0}

    def of_bsdf_glossy(self, node):
        return {**PLAIN, "color": self.number(node, "Color"), "roughness": self.number(node, "Roughness"), "metallic": 1.0}

    of_bsdf_anisotropic = of_bsdf_glossy

    def of_bsdf_metallic(self, node):
        return {**PLAIN, "color": self.number(node, "Base Color"), "roughness": self.number(node, "Roughness"), "metallic": 1.0}

    def of_bsdf_glass(self, node):
        # Its colour tints each interface; glTF's, like the Principled BSDF's, both together.
        color = tuple(c * c for c in self.number(node, "Color"))
        ior, roughness = max(self.number(node, "IOR"), 1.0), self.number(node, "Roughness")
        return {**PLAIN, "color": color, "transmission": 1.0, "ior": ior, "roughness": roughness}

    def of_bsdf_refraction(self, node):
        self.note(f"{node.name} is shown as glass, which also reflects")
        return self.of_bsdf_glass(node)

    def of_bsdf_transparent(self, node):
        if min(self.number(node, "Color")) < 0.999:
            self.note(f"the colour of {node.name} is ignored")
        return {**BLACK, "alpha": 0.0}

    def of_bsdf_translucent(self, node):
        return {**BLACK, "translucent": 1.0, "through": self.number(node, "Color")}

    def of_subsurface_scattering(self, node):
        self.note(f"{node.name} is shown as a diffuse reflection")
        return {**PLAIN, "color": self.number(node, "Color"), "roughness": 1.0, "specular": 0.0}

    def of_bsdf_sheen(self, node):
        return {**BLACK, "sheen": self.number(node, "Color"), "sheen_roughness": self.number(node, "Roughness")}

    def of_emission(self, node):
        strength = self.number(node, "Strength")
        return {**BLACK, "emission": tuple(c * strength for c in self.number(node, "Color"))}

    def of_add_shader(self, node):
        a, b = self.shader(node, 0), self.shader(node, 1)
        if a is None or b is None:
            return a or b
        if a["translucent"] == 1.0 or b["translucent"] == 1.0:
            through, base = (a, b) if a["translucent"] == 1.0 else (b, a)
            if is_plain(base) and not is_dark(base) and a["alpha"] == b["alpha"] == 1.0:
                look, fits = added(base, through)
                if not fits:
                    self.note(f"{node.name} adds colours that one base cannot have both: they are clipped")
                return look
        lit, base = (a, b) if is_dark(a) else (b, a)
        if not is_dark(lit):
            self.note(f"{node.name} adds two surfaces: only the first is shown")
            return a
        return {**base, "emission": tuple(x + y for x, y in zip(a["emission"], b["emission"], strict=True))}

    def of_mix_shader(self, node):
        a, b = self.shader(node, 1), self.shader(node, 2)
        factor = source_of(node.inputs[0])
        if a is None or b is None:
            # An empty input is black.
            a, b = a or BLACK, b or BLACK
        if factor is not None and factor.type == "LIGHT_PATH":
            self.note(f"{node.name} chooses by Light Path: the first shader is shown to all rays")
            return a
        if factor is not None and factor.type in ("FRESNEL", "LAYER_WEIGHT") and b["metallic"] == 1.0:
            ior = self.number(factor, "IOR") or 1.5
            if a["transmission"] == 1.0 or a["metallic"] == 0.0:
                return {**a, "ior": max(ior, 1.0), "specular": 1.0, "roughness": b["roughness"]}
        share = min(max(self.number(node, "Fac", "Factor"), 0.0), 1.0)
        return self.mixed(node, a, b, share)

    def mixed(self, node, a, b, share):
        """Transparency is alpha; all else is a mean of the numbers, exact where shaders differ in colour and emission alone."""
        if share in (0.0, 1.0):
            return b if share else a
        if is_clear(a) or is_clear(b):
            look, seen = (b, share) if is_clear(a) else (a, 1 - share)
            return {**look, "alpha": look["alpha"] * seen}
        exact = {"color", "emission", "alpha", "principled", "translucent", "through"}
        if any(a.get(key) != b.get(key) for key in a if key not in exact):
            self.note(f"{node.name} mixes two shaders: one with the mean of their numbers is shown")
        look = {key: mean(a[key], b[key], share) for key in PLAIN}
        # Numbers of what is not there do not count.
        parts = {
            "sheen_roughness": lambda look: strongest(look["sheen"]),
            "coat_roughness": lambda look: look["coat"],
            "color": lambda look: 1 - look["translucent"],
            "through": lambda look: look["translucent"],
        }
        for key, weight in parts.items():
            weights = [(1 - share) * weight(a), share * weight(b)]
            if sum(weights) > 0:
                look[key] = mean(a[key], b[key], weights[1] / sum(weights))
        look["principled"] = a.get("principled") or b.get("principled")
        return look


def strongest(value):
    return max(value) if isinstance(value, tuple) else value


def mean(a, b, share):
    if isinstance(a, tuple):
        return tuple(mean(x, y, share) for x, y in zip(a, b, strict=True))
    return (1 - share) * a + share * b


def added(look, other):
    """A look whose base transmits what the other one does beside what it reflects, and whether colours of at most 1 can say so."""
    reflected, transmitted = max(look["color"]), max(other["through"])
    share = transmitted / max(reflected + transmitted, 1e-6)
    scaled = lambda color, part: tuple(c / part if part > 0 else 0.0 for c in color)
    color, through = scaled(look["color"], 1 - share), scaled(other["through"], share)
    emission = tuple(x + y for x, y in zip(look["emission"], other["emission"], strict=True))
    fits = max(*color, *through) <= 1.001
    return {**look, "color": color, "translucent": share, "through": through, "emission": emission}, fits


def is_plain(look):
    """True for a base that reflects diffusely, under a coat or not, and nothing else."""
    return look["metallic"] == look["transmission"] == look["translucent"] == look["coat"] == max(look["sheen"]) == 0.0


def is_clear(look):
    return look["alpha"] == 0.0


def is_dark(look):
    """True for a shader that only emits."""
    dark = look["color"] == (0.0, 0.0, 0.0) and look["specular"] == 0.0 and look["alpha"] == 1.0
    return dark and look["translucent"] == 0.0


def blackbody(kelvin):
    """Colour of a black body without its brightness: the loci of Krystek (1985), to linear Rec. 709 with a luminance of 1."""
    t = float(kelvin)
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t * t) / (1 + 8.42420235e-4 * t + 7.08145163e-7 * t * t)
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t * t) / (1 - 2.89741816e-5 * t + 1.61456053e-7 * t * t)
    x, y = 3 * u / (2 * u - 8 * v + 4), 2 * v / (2 * u - 8 * v + 4)
    big_x, big_z = x / y, (1 - x - y) / y
    rgb = (
        3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z,
        -0.969266 * big_x + 1.8760108 + 0.041556 * big_z,
        0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z,
    )
    return tuple(max(c, 0.0) for c in rgb)


def source_of(socket):
    """The node that is linked to a socket, through reroutes; None without one."""
    while socket.is_linked:
        link = socket.links[0]
        if link.is_muted:
            return None
        if link.from_node.type != "REROUTE":
            return link.from_node
        socket = link.from_node.inputs[0]
    return None


def output_of(tree):
    """The active output of a node tree of a material or a world."""
    return next((n for n in tree.nodes if n.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD") and n.is_active_output), None)


def before(node, seen=None):
    """All nodes on which a node depends."""
    seen = set() if seen is None else seen
    for socket in node.inputs:
        for link in socket.links:
            if link.from_node.name not in seen:
                seen.add(link.from_node.name)
                yield link.from_node
                yield from before(link.from_node, seen)


def absorption(node):
    """Absorption coefficients of a volume shader in 1/m, or None for another one."""
    if node.type == "VOLUME_ABSORPTION":
        density = node.inputs["Density"].default_value
        return tuple(density * max(1 - c, 0.0) for c in node.inputs["Color"].default_value[:3])
    if node.type == "VOLUME_COEFFICIENTS":
        scatters = max(node.inputs["Scatter Coefficients"].default_value) > 0
        return None if scatters else tuple(node.inputs["Absorption Coefficients"].default_value)
    return None


def translate(glb, material):
    """Completes a material of the exporter; returns notes on what is not translated."""
    target, reader = glb.material(material.name), Reader(material.name)
    output = output_of(material.node_tree) if material.use_nodes and material.node_tree else None
    if target is None or output is None:
        return []
    surface, volume = source_of(output.inputs["Surface"]), source_of(output.inputs["Volume"])
    if source_of(output.inputs["Displacement"]) is not None:
        reader.note("displacement is not translated")
    principled = surface is not None and surface.type == "BSDF_PRINCIPLED"
    if principled:
        check_principled(reader, surface)
    else:
        look = reader.look(surface)
        set_look(glb, target, look or (BLACK if surface is None else PLAIN))
    if volume is not None:
        inside = absorption(volume)
        if inside is None:
            reader.note(f"{volume.name} is not translated")
        else:
            set_absorption(glb, target, inside)
    return reader.notes


def check_principled(reader, node):
    """Notes what the exporter loses of a Principled BSDF."""
    for socket in node.inputs:
        first = source_of(socket)
        if first is None:
            continue
        lost = [n.name for n in [first, *before(first)] if n.type not in TEXTURED]
        if lost:
            reader.note(f"{socket.name} comes from {', '.join(sorted(lost))}, not from an image")
    weight = node.inputs.get("Subsurface Weight")
    if weight is not None and (weight.is_linked or weight.default_value > 0):
        reader.note("subsurface scattering is shown as a diffuse reflection")


def set_look(glb, target, look):
    """Writes a look into a material of glTF, whose textures stay where the look is a Principled BSDF's."""
    clip = lambda values: [min(max(float(c), 0.0), 1.0) for c in values]
    if not look.get("principled"):
        for key in ("normalTexture", "emissiveTexture", "occlusionTexture"):
            target.pop(key, None)
        target["pbrMetallicRoughness"] = {}
        target["extensions"] = {}
    pbr, extensions = target.setdefault("pbrMetallicRoughness", {}), target.setdefault("extensions", {})
    pbr["baseColorFactor"] = clip((*look["color"], look["alpha"]))
    pbr["metallicFactor"], pbr["roughnessFactor"] = clip((look["metallic"], look["roughness"]))
    if look["alpha"] < 1:
        target["alphaMode"] = "BLEND"
    else:
        target.pop("alphaMode", None)
    emission, strongest = look["emission"], max(look["emission"])
    target["emissiveFactor"] = clip(c / max(strongest, 1.0) for c in emission)
    target["doubleSided"] = target.get("doubleSided", True)
    parts = {
        "KHR_materials_emissive_strength": {"emissiveStrength": strongest} if strongest > 1 else None,
        "KHR_materials_ior": {"ior": look["ior"]},
        "KHR_materials_specular": specular(look["specular"]),
        "KHR_materials_transmission": {"transmissionFactor": look["transmission"]} if look["transmission"] > 0 else None,
        "KHR_materials_clearcoat": {"clearcoatFactor": look["coat"], "clearcoatRoughnessFactor": look["coat_roughness"]}
        if look["coat"] > 0
        else None,
        "KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": look["translucent"],
            "diffuseTransmissionColorFactor": clip(look["through"]),
        }
        if look["translucent"] > 0
        else None,
        "KHR_materials_sheen": {"sheenColorFactor": list(look["sheen"]), "sheenRoughnessFactor": look["sheen_roughness"]}
        if max(look["sheen"]) > 0
        else None,
    }
    for name, value in parts.items():
        extensions.pop(name, None)
        if value is not None:
            extensions[name] = value
            glb.uses(name)


def specular(level):
    """Blender's level, of which 1 is the reflectance of the index: above that the colour grows."""
    return {"specularFactor": min(level, 1.0), "specularColorFactor": [max(level, 1.0)] * 3}


def set_absorption(glb, target, coefficients):
    """Makes a material bound an absorbing body: the colour that is left after a length at which the strongest is 1/e."""
    strongest = max(coefficients)
    extensions = target.setdefault("extensions", {})
    transmits = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > 0
    if strongest <= 0 or not transmits:
        return
    length = 1 / strongest
    glb.uses("KHR_materials_volume")
    extensions["KHR_materials_volume"] = {
        "thicknessFactor": 1.0,
        "attenuationDistance": length,
        "attenuationColor": [math.exp(-c * length) for c in coefficients],
    }
    # A body with a thickness tints at each interface by the whole base colour.
    pbr = target.setdefault("pbrMetallicRoughness", {})
    *color, alpha = pbr.get("baseColorFactor", [1, 1, 1, 1])
    pbr["baseColorFactor"] = [*(math.sqrt(c) for c in color), alpha]
