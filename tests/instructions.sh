#!/usr/bin/env bash
# Counts the instructions of a sample of a diffuse box, and how many more it takes when features are there that the box
# does not use: more than 0.5 % is a failure.
#
#     cargo build --release && tests/instructions.sh target/release/opsr
#
# Needs valgrind and python3. Not part of the automatic tests: it takes minutes. The count of one sample is the
# difference of two renders, so that loading and writing do not count; one thread, so that it is the same every time.
set -eu
program=$(realpath "$1")
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A box of diffuse walls with two blocks and a lamp: as it is, and with what a scene may carry without showing it.
python3 - "$work" <<'PYTHON'
import base64, copy, json, math, struct, sys

folder = sys.argv[1]
quads = []  # four corners, material

def block(centre, half, turn, material):
    c, s = math.cos(turn), math.sin(turn)
    def at(x, y, z):
        x, y, z = x * half[0], y * half[1], z * half[2]
        return (centre[0] + c * x + s * z, centre[1] + y, centre[2] - s * x + c * z)
    for axis in range(3):
        for side in (-1, 1):
            corners = []
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                p = [0, 0, 0]
                p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, a * side, b
                corners.append(at(*p))
            quads.append((corners, material))

quads += [
    ([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], 0),
    ([(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)], 0),
    ([(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)], 0),
    ([(-1, 0, 1), (-1, 0, -1), (-1, 2, -1), (-1, 2, 1)], 1),
    ([(1, 0, -1), (1, 0, 1), (1, 2, 1), (1, 2, -1)], 2),
    ([(-0.3, 1.99, -0.3), (0.3, 1.99, -0.3), (0.3, 1.99, 0.3), (-0.3, 1.99, 0.3)], 3),
]
block((0.4, 0.3, 0.4), (0.3, 0.3, 0.3), -0.3, 0)
block((-0.35, 0.6, -0.3), (0.3, 0.6, 0.3), 0.35, 0)

def diffuse(*colour):
    return {"pbrMetallicRoughness": {"baseColorFactor": [*colour, 1], "metallicFactor": 0, "roughnessFactor": 1},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}

lamp = diffuse(0, 0, 0)
lamp["emissiveFactor"] = [1, 1, 1]
lamp["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": 10}
gltf = {
    "asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength"],
    "materials": [diffuse(0.7, 0.7, 0.7), diffuse(0.6, 0.1, 0.1), diffuse(0.1, 0.5, 0.1), lamp],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1}}],
    "bufferViews": [], "accessors": [], "meshes": [{"primitives": []}],
    "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 1, 3.8]}],
    "scenes": [{"nodes": [0, 1]}], "scene": 0,
}
data = b""

def accessor(values, kind, component):
    global data
    flat = [x for v in values for x in v] if kind == "VEC3" else values
    raw = struct.pack("<%d%s" % (len(flat), "f" if component == 5126 else "I"), *flat)
    gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
    data += raw
    entry = {"bufferView": len(gltf["bufferViews"]) - 1, "componentType": component, "count": len(values), "type": kind}
    if kind == "VEC3":
        entry["min"] = [min(v[i] for v in values) for i in range(3)]
        entry["max"] = [max(v[i] for v in values) for i in range(3)]
    gltf["accessors"].append(entry)
    return len(gltf["accessors"]) - 1

for material in range(4):
    points, indices = [], []
    for corners, m in quads:
        if m == material:
            n = len(points)
            points += corners
            indices += [n, n + 1, n + 2, n, n + 2, n + 3]
    primitive = {"attributes": {"POSITION": accessor(points, "VEC3", 5126)},
                 "indices": accessor(indices, "SCALAR", 5125), "material": material}
    gltf["meshes"][0]["primitives"].append(primitive)

def write(name, gltf):
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    gltf["buffers"] = [{"byteLength": len(data), "uri": uri}]
    json.dump(gltf, open("%s/%s.gltf" % (folder, name), "w"))

write("box", gltf)
# Materials of every kind, a texture and a mesh that nothing shows, a second camera.
more = copy.deepcopy(gltf)
png = ("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==")
more["images"] = [{"uri": "data:image/png;base64," + png}]
more["textures"] = [{"source": 0}]
more["materials"] += [
    {"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0.1}},
    {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
     "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_ior": {"ior": 1.5},
                    "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1}}},
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "roughnessFactor": 0.3}, "normalTexture": {"index": 0}},
]
more["extensionsUsed"] += ["KHR_materials_transmission", "KHR_materials_ior", "KHR_materials_volume"]
more["meshes"].append({"primitives": [dict(more["meshes"][0]["primitives"][0], material=5)]})
more["cameras"].append(more["cameras"][0])
more["nodes"].append({"camera": 1})
more["scenes"][0]["nodes"].append(2)
write("more", more)
PYTHON

# instructions SCENE SPP [OPTIONS]: of the whole program.
instructions() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" render "$work/$1.gltf" --size 48x48 --spp "$2" \
        --camera 0 --seed 1 --resolve raw --threads 1 --reproducible --progress none -o "$work/out.exr" "${@:3}" 2>&1 |
        awk '/Collected/ { print $NF } /opsr:/ { print > "/dev/stderr" }'
}

# count SCENE [OPTIONS]: of eight samples of all pixels.
count() {
    few=$(instructions "$1" 2 "${@:2}")
    many=$(instructions "$1" 10 "${@:2}")
    echo $((many - few))
}

base=$(count box)
failed=0
# compare NAME BOUND SCENE [OPTIONS]; no bound for what is only told.
compare() {
    n=$(count "${@:3}")
    awk -v n="$n" -v base="$base" -v name="$1" -v bound="$2" 'BEGIN {
        off = 100 * (n / base - 1); bad = bound != "-" && (off > bound || off < -bound)
        printf "%-52s %12d  %+7.3f %%%s\n", name, n, off, bad ? "  MORE THAN " bound " %" : ""; exit bad }' || failed=1
}

printf '%-52s %12d\n' "the box" "$base"
compare "the box again" 0.5 box
compare "--opsr-table 0" 0.5 box --opsr-table 0
compare "unused materials, textures, meshes and cameras" 0.5 more
compare "with a table, which a diffuse box does not need" 0.5 box --opsr-table params/beta-0.001.json
compare "with a table, going on with roughened lobes" 0.5 box --opsr-table params/beta-0.001.json --set mode=reuse
compare "albedo, normal and depth (used, for comparison)" - box --aov
exit "$failed"
