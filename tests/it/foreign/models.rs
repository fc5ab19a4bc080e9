//! OBJ and PLY files as scenes of their own.

use opsr::math::{Rgb, Vec2, Vec3, luminance};
use opsr::scene::load::{FileLight, Loaded, load};
use opsr::scene::{Material, Mesh, Scene, SceneParts, Texels};
use opsr_lab::gallery::{materials, shapes};
use std::fmt::Write;

/// Reads the first of the files; the others are in its folder.
fn read(files: &[(&str, &[u8])]) -> Result<Loaded, String> {
    let folder = crate::support::quick_folder();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    load(&folder.path().join(files[0].0), &opsr_formats::options()).map_err(|e| e.to_string())
}

fn read_obj(text: &str, mtl: &str) -> Result<Loaded, String> {
    read(&[("a.obj", text.as_bytes()), ("a.mtl", mtl.as_bytes())])
}

/// A ball as OBJ text, where v grows upwards.
fn written(mesh: &Mesh) -> String {
    let mut out = String::new();
    for ((p, n), uv) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.uvs) {
        writeln!(out, "v {:?} {:?} {:?}", p.x, p.y, p.z).expect("text");
        writeln!(out, "vn {:?} {:?} {:?}", n.x, n.y, n.z).expect("text");
        writeln!(out, "vt {:?} {:?}", uv.x, 1.0 - uv.y).expect("text");
    }
    for face in &mesh.indices {
        let [a, b, c] = face.map(|i| format!("{0}/{0}/{0}", i + 1));
        writeln!(out, "f {a} {b} {c}").expect("text");
    }
    out
}

#[test]
fn models_of_all_formats_are_one_mesh() {
    let mut ball = shapes::sphere(Vec3::new(0.1, -0.2, 0.3), 0.7, 2);
    ball.uvs = (ball.positions.iter())
        .map(|p| Vec2::new(p.x, 0.25 * p.y))
        .collect();
    let mut ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n",
        ball.positions.len()
    );
    for name in ["x", "y", "z", "nx", "ny", "nz", "u", "v"] {
        writeln!(ply, "property float {name}").expect("text");
    }
    for name in ["red", "green", "blue"] {
        writeln!(ply, "property uchar {name}").expect("text");
    }
    writeln!(
        ply,
        "element face {}\nproperty list uchar int vertex_indices\nend_header",
        ball.indices.len()
    )
    .expect("text");
    for ((p, n), uv) in ball.positions.iter().zip(&ball.normals).zip(&ball.uvs) {
        writeln!(
            ply,
            "{:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} 255 188 0",
            p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y
        )
        .expect("text");
    }
    for [a, b, c] in &ball.indices {
        writeln!(ply, "3 {a} {b} {c}").expect("text");
    }
    let corners = |mesh: &Mesh| -> Vec<[(Vec3, Vec3, Vec2); 3]> {
        let corner = |i: u32| {
            let i = i as usize;
            (mesh.positions[i], mesh.normals[i], mesh.uvs[i])
        };
        mesh.indices.iter().map(|face| face.map(corner)).collect()
    };
    let of_obj = read_obj(&written(&ball), "").expect("a model");
    let of_ply = read(&[("a.ply", ply.as_bytes())]).expect("a model");
    for (loaded, painted) in [(&of_obj, false), (&of_ply, true)] {
        assert_eq!(loaded.light, FileLight::None);
        assert_eq!(loaded.warnings, Vec::<String>::new());
        let (mesh, material) = (&loaded.parts.meshes[0], &loaded.parts.materials[0]);
        for (a, b) in corners(mesh)
            .iter()
            .flatten()
            .zip(corners(&ball).iter().flatten())
        {
            assert_eq!(a.0, b.0);
            assert!(
                a.1.distance(b.1) < 1e-6 && a.2.distance(b.2) < 1e-6,
                "{a:?} {b:?}"
            );
        }
        assert_eq!(
            material.finish.as_ref().is_some_and(|f| f.has_colors),
            painted
        );
        assert_eq!(
            material.base_color,
            Rgb::splat(if painted { 1.0 } else { 0.8 })
        );
    }
    // 188 of 255 is about one half in linear values.
    let color = of_ply.parts.meshes[0].colors[0];
    assert!(
        color.truncate().distance(Vec3::new(1.0, 0.5, 0.0)) < 0.01,
        "{color}"
    );
}

/// The material of a triangle with this MTL text.
fn material(mtl: &str) -> Material {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl of it\nf 1 2 3\n";
    let loaded = read_obj(obj, &format!("newmtl of it\n{mtl}")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.warnings, Vec::<String>::new(), "{mtl}");
    let [material] = &loaded.parts.materials[..] else {
        panic!("one material");
    };
    assert_eq!(material.name, "of it");
    material.clone()
}

#[test]
fn materials_of_obj_files_are_read() {
    let matte = material("Kd 0.5 0.25 0.1\nillum 1\nKs 1 1 1\n");
    assert_eq!(matte.base_color, Rgb::new(0.5, 0.25, 0.1));
    assert_eq!(
        (matte.specular, matte.metallic, matte.transmission),
        (0.0, 0.0, 0.0)
    );
    // Plastic as Blender writes it, and with half of its highlight.
    let plastic =
        material("Ns 250\nKa 1 1 1\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNi 1.45\nd 1\nillum 2\n");
    assert_eq!(
        (plastic.specular, plastic.ior, plastic.metallic),
        (1.0, 1.45, 0.0)
    );
    assert!((plastic.alpha - (2.0f32 / 252.0).sqrt()).abs() < 1e-6);
    assert_eq!(material("Ks 0.25 0.25 0.25").specular, 0.5);
    // Metal as older programs write it, as Blender writes it, and by its own parameter.
    let mirror = material("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3\nNs 100000");
    assert_eq!(
        (mirror.metallic, mirror.base_color),
        (1.0, Rgb::new(0.9, 0.8, 0.7))
    );
    let copper = material("Ka 1 1 1\nKd 0.9 0.5 0.3\nKs 0.5 0.5 0.5\nillum 3\nNs 10");
    assert_eq!(
        (copper.metallic, copper.base_color),
        (1.0, Rgb::new(0.9, 0.5, 0.3))
    );
    let brushed = material("Kd 0.9 0.5 0.3\nPm 0.75\nPr 0.5");
    assert_eq!(
        (brushed.metallic, brushed.alpha, brushed.specular),
        (0.75, 0.25, 1.0)
    );
    // A glossy paint with reflections is no metal.
    assert_eq!(
        material("Kd 0.7 0 0\nKs 0.1 0.1 0.1\nillum 3").metallic,
        0.0
    );
    // Glass refracts, foil does not.
    let glass = material("d 0.1\nillum 4\nNi 1.52\nNs 400\nTf 0.9 1 0.9");
    assert_eq!(
        (glass.transmission, glass.solid, glass.ior, glass.alpha),
        (1.0, true, 1.52, 0.0)
    );
    assert_eq!(
        (glass.opacity, glass.base_color),
        (1.0, Rgb::new(0.9, 1.0, 0.9))
    );
    let foil = material("Tr 0.75\nKd 1 1 1");
    assert_eq!(
        (foil.opacity, foil.transmission, foil.solid),
        (0.25, 0.0, false)
    );
    // A lamp emits from both sides.
    let lamp = material("Ke 4 3 2\nKd 0 0 0");
    assert_eq!(
        (lamp.emission, lamp.double_sided),
        (Rgb::new(4.0, 3.0, 2.0), true)
    );
    // Comments and blanks are skipped, and the last of two equal lines counts.
    assert_eq!(
        material("  Kd 1 0 0 # red\n\n\tKd 0 1 0").base_color,
        Rgb::Y
    );
}

/// A picture with a different colour in each quarter.
fn quarters() -> Vec<u8> {
    let picture = image::RgbImage::from_fn(4, 4, |x, y| {
        image::Rgb([
            if x < 2 { 0 } else { 255 },
            if y < 2 { 0 } else { 255 },
            128,
        ])
    });
    crate::support::gltf::png(&picture.into())
}

#[test]
fn textures_of_obj_files_lie_as_the_file_says() {
    let png = quarters();
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.2 0.1\nvt 0.6 0.2\nvt 0.3 0.9\nvn 0 0 1\nusemtl x\nf 1/1/1 2/2/1 3/3/1\n";
    for (options, scale, offset) in [
        ("", Vec2::ONE, Vec2::ZERO),
        ("-s 2 3 1 ", Vec2::new(2.0, 3.0), Vec2::ZERO),
        (
            "-o 0.25 0.5 0 -s 2 1 -clamp off -mm 0 1 ",
            Vec2::new(2.0, 1.0),
            Vec2::new(0.25, 0.5),
        ),
        ("-blendu on -bm 2 ", Vec2::ONE, Vec2::ZERO),
    ] {
        let mtl = format!("newmtl x\nKd 0 0 0\nmap_Kd {options}a picture.png\n");
        let loaded = read(&[
            ("a.obj", obj),
            ("a.mtl", mtl.as_bytes()),
            ("a picture.png", &png),
        ]);
        let parts = loaded.unwrap_or_else(|e| panic!("{e}")).parts;
        let material = &parts.materials[0];
        // Exporters write black next to a texture.
        assert_eq!(material.base_color, Rgb::ONE);
        let map = material.base_color_texture.expect("a texture");
        assert!(matches!(
            parts.textures[map.texture as usize].texels,
            Texels::Byte(_)
        ));
        assert!(parts.textures[map.texture as usize].srgb);
        for (uv, file) in parts.meshes[0]
            .uvs
            .iter()
            .zip([[0.2, 0.1], [0.6, 0.2], [0.3, 0.9]])
        {
            let meant = scale * Vec2::from(file) + offset;
            let there = map.transform.transform_point2(*uv);
            assert!(
                there.distance(Vec2::new(meant.x, 1.0 - meant.y)) < 1e-6,
                "{options}"
            );
        }
    }
    let mtl =
        b"newmtl x\nmap_d a.png\nd 0.5\nmap_Ke a.png\nKe 2 2 2\nbump -bm 0.1 a.png\nmap_Pr a.png\n";
    let loaded = read(&[("a.obj", obj), ("a.mtl", mtl), ("a.png", &png)]);
    let parts = loaded.unwrap_or_else(|e| panic!("{e}")).parts;
    let material = &parts.materials[0];
    assert!(material.emissive_texture.is_some() && material.emission == Rgb::splat(2.0));
    assert!(material.normal_texture.is_some() && material.metallic_roughness_texture.is_some());
    assert_eq!((material.alpha, parts.meshes[0].tangents.len()), (1.0, 3));
    let holes = material.base_color_texture.expect("opacity");
    let [.., opacity] = parts.textures[holes.texture as usize].sample(Vec2::splat(0.375));
    assert!(
        (opacity - 0.5 * 128.0 / 255.0 / 3.0).abs() < 2e-3,
        "{opacity}"
    );
}

#[test]
fn parts_of_obj_files_have_their_materials() {
    let obj = "mtllib none.mtl a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 1 1 0 1 1 1\nf 1 2 3\nusemtl red\nf 2 \\\n4 3\n\
               usemtl blue\nusemtl gone\nf 1 2 3\nusemtl red\nf -4 -3 -1\n";
    let mtl = "newmtl red\nKd 1 0 0\nrefl map\nPs 0\nPc 0.5\nKa 1 1 1\nnewmtl blue\nKd 0 0 1\n";
    let loaded = read_obj(obj, mtl).expect("a model");
    let faces: Vec<(Rgb, usize, usize)> = (loaded.parts.meshes.iter())
        .map(|mesh| {
            let material = &loaded.parts.materials[mesh.material as usize];
            (
                material.base_color,
                mesh.indices.len(),
                mesh.positions.len(),
            )
        })
        .collect();
    // Vertex colours replace the base colour of all parts.
    assert_eq!(
        faces,
        [(Rgb::ONE, 1, 3), (Rgb::ONE, 2, 4), (Rgb::ONE, 1, 3)]
    );
    let report = loaded.warnings.join("\n");
    for words in [
        "none.mtl cannot be read",
        "gone is no material",
        "a.mtl:1 (`red`) `refl` is not read",
        "a.mtl:1 (`red`) `Pc` is not read",
    ] {
        assert!(report.replace(": ", " ").contains(words), "{report}");
    }
    assert_eq!(loaded.parts.meshes[1].colors[0].truncate(), Vec3::Y);
}

#[test]
fn faults_of_models_name_their_place() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (obj, mtl, words) in [
        (
            format!("{triangle}f 1 2 4"),
            "",
            "a.obj: line:4: a corner that does not exist",
        ),
        (triangle.to_owned(), "", "a.obj: body: has no faces"),
        (
            "v 0 0 x".to_owned(),
            "",
            "a.obj: line:1: a word that is no number",
        ),
        (
            format!("mtllib a.mtl\n{triangle}usemtl x\nf 1 2 3"),
            "newmtl x\nKd 1 zwei 3",
            "a.mtl:1 (`x`): `Kd 1 zwei 3`: expected numbers",
        ),
        (
            format!("mtllib a.mtl\n{triangle}usemtl x\nf 1 2 3"),
            "newmtl x\nmap_Kd none.png",
            "a.mtl:1 (`x`): cannot read",
        ),
    ] {
        let report = read_obj(&obj, mtl).expect_err("an error");
        assert!(report.contains(words), "{report}");
    }
    let report = read(&[("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n")]);
    assert!(report.expect_err("an error").contains("has no faces"));
}

/// A model's lamp lights the room, and glass from an OBJ file equals the glass of the same glTF file.
#[test]
fn models_bring_their_light_and_bodies() {
    let mut room = SceneParts::default();
    room.add(
        materials::diffuse("white", Rgb::splat(0.7)),
        [shapes::sphere(Vec3::ZERO, 0.5, 3)],
    );
    let ball = &room.meshes[0];
    let mut text = format!("mtllib a.mtl\nusemtl glass\n{}", {
        let mut ball = ball.clone();
        ball.uvs = vec![Vec2::ZERO; ball.positions.len()];
        written(&ball)
    });
    let first = ball.positions.len();
    for [x, z] in [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]] {
        writeln!(text, "v {x} 2 {z}").expect("text");
    }
    writeln!(
        text,
        "usemtl lamp\nf {} {} {} {}",
        first + 1,
        first + 2,
        first + 3,
        first + 4
    )
    .expect("text");
    let loaded =
        read_obj(&text, "newmtl glass\nd 0\nillum 7\nnewmtl lamp\nKe 5 5 5\n").expect("a model");
    assert_eq!(loaded.light, FileLight::Surfaces);
    let scene = Scene::new(loaded.parts);
    assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
    assert_eq!(scene.lights().emissive_triangles(), 2);
    let glass = &scene.parts().materials[0];
    assert!(glass.solid && luminance(glass.base_color) == 1.0);
}
