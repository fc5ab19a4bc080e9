//! Converts a scene of another format to the material and light models of glTF.

use opsr::bsdf::fresnel::conductor;
use opsr::math::{Rgb, Vec2};
use opsr::scene::finish::{ExactCover, Finish, Translucency};
use opsr::scene::light::Falloff;
use opsr::scene::{AlphaMode, Material, PunctualLight, SceneParts, Texture, TextureRef};

/// Scene parts that [`glb`](super::glb) can write, and their differences from the original.
#[derive(Clone, Debug)]
pub struct Lowered {
    /// The parts.
    pub parts: SceneParts,
    /// Features left out, one line each: the picture differs.
    pub lost: Vec<String>,
    /// Features approximated by glTF's models, one line each: the picture is close.
    pub changed: Vec<String>,
}

/// Converts scene parts to those that a glTF file can express.
pub fn lowered(mut parts: SceneParts) -> Lowered {
    let (mut lost, mut changed) = (Vec::new(), Vec::new());
    let count = |list: &mut Vec<String>, n: usize, what: &str| {
        if n > 0 {
            list.push(format!("{n} {what}"));
        }
    };
    for shared in std::mem::take(&mut parts.shared) {
        let meshes = shared.poses.iter().map(|pose| shared.mesh.at(pose));
        parts.meshes.extend(meshes);
    }
    count(
        &mut lost,
        parts.textures.len(),
        "textures: the mean of a colour is kept",
    );
    let textures = std::mem::take(&mut parts.textures);
    let sky = parts.environment.take().is_some();
    count(&mut lost, usize::from(sky), "environment");
    let lenses = parts.cameras.iter().filter(|c| c.lens.is_some()).count();
    count(&mut lost, lenses, "lenses");
    let shifts = parts.cameras.iter().filter(|c| c.shift != Vec2::ZERO);
    count(&mut lost, shifts.count(), "shifts of the picture");
    let has = |test: fn(&Material) -> bool| parts.materials.iter().filter(|m| test(m)).count();
    let mixed = |m: &Material| m.finish.as_ref().is_some_and(|f| f.mix.is_some());
    let exact = |m: &Material| m.finish.as_ref().is_some_and(|f| f.exact.is_some()) || m.exact_wall;
    count(
        &mut lost,
        has(mixed),
        "mixtures of materials: the first of each is kept",
    );
    count(
        &mut lost,
        has(|m| m.alpha_mode == AlphaMode::Unseen),
        "lamps that are not seen: their light is left out",
    );
    count(
        &mut lost,
        has(|m| m.ior < 1.0),
        "indices of refraction below 1: 1 is written",
    );
    count(
        &mut changed,
        has(exact),
        "materials by Schlick's approximation",
    );
    let filled = has(|m| m.medium.is_some()) + usize::from(parts.medium.take().is_some());
    count(&mut lost, filled, "media");
    for light in &mut parts.lights {
        if let PunctualLight::Spot { falloff, .. } = light
            && *falloff != Falloff::Squared
        {
            *falloff = Falloff::Squared;
            changed.push("1 spot light by glTF's fall-off".into());
        }
    }
    let mut unlike = 0;
    for material in &mut parts.materials {
        *material = plain(material, &textures);
        unlike += usize::from(clipped(material));
    }
    count(
        &mut lost,
        unlike,
        "colours of light that is reflected and transmitted, which one base cannot have both",
    );
    for mesh in &mut parts.meshes {
        mesh.tangents.clear();
        // A glTF file applies colours wherever a mesh has them.
        let finish = &parts.materials[mesh.material as usize].finish;
        if !finish.as_ref().is_some_and(|f| f.has_colors) {
            mesh.colors.clear();
        }
    }
    Lowered {
        parts,
        lost,
        changed,
    }
}

/// A material without textures and without features that glTF does not have.
fn plain(material: &Material, textures: &[Texture]) -> Material {
    let mean = |map: &Option<TextureRef>| {
        let texture = (map.as_ref()).and_then(|map| textures.get(map.texture as usize));
        texture.map_or(Rgb::ONE, |texture| {
            let [r, g, b, _] = texture.average();
            Rgb::new(r, g, b)
        })
    };
    let mut out = Material {
        base_color: material.base_color * mean(&material.base_color_texture),
        emission: material.emission * mean(&material.emissive_texture),
        base_color_texture: None,
        metallic_roughness_texture: None,
        normal_texture: None,
        emissive_texture: None,
        transmission_texture: None,
        exact_wall: false,
        ior: material.ior.max(1.0),
        double_sided: material.double_sided
            || material.shows_back && material.emission == Rgb::ZERO,
        shows_back: false,
        finish: None,
        ..material.clone()
    };
    let Some(finish) = &material.finish else {
        return out;
    };
    match finish.exact {
        Some(ExactCover::Metal { eta, k }) => {
            let f0 = |c: usize| conductor(1.0, eta[c], k[c]);
            out.base_color *= Rgb::new(f0(0), f0(1), f0(2));
        }
        Some(cover) => out.base_color = cover.effective_albedo(out.base_color),
        None => {}
    }
    let coat = finish.clearcoat.clone().map(|mut coat| {
        (coat.texture, coat.roughness_texture, coat.normal_texture) = (None, None, None);
        coat
    });
    let brushing = finish.anisotropy.clone().filter(|a| a.texture.is_none());
    let through = finish.translucency.map(|through| {
        let opacity = (through.texture.as_ref()).and_then(|map| textures.get(map.texture as usize));
        let weight = through.weight * opacity.map_or(1.0, |texture| texture.average()[3]);
        let color = through.color * mean(&through.color_texture);
        let (base, through) = shared_base(out.base_color, weight, color, through.keeps_base);
        out.base_color = base;
        through
    });
    let sheen = finish.sheen.clone().map(|mut sheen| {
        sheen.color *= mean(&sheen.color_texture.take());
        sheen.roughness_texture = None;
        sheen
    });
    let film = finish.film.clone().map(|mut film| {
        film.weight *= mean(&film.texture.take()).x;
        let [least, most] = film.thickness;
        let share = mean(&film.thickness_texture.take()).y;
        film.thickness = [least, least + share * (most - least)];
        film
    });
    let kept = Finish {
        clearcoat: coat,
        anisotropy: brushing,
        translucency: through,
        sheen,
        film,
        lamp: finish.lamp,
        has_colors: finish.has_colors,
        ..Finish::default()
    };
    out.finish = Some(Box::new(kept));
    out
}

/// Base colour and translucency for glTF, where reflection and transmission share one base.
fn shared_base(base: Rgb, weight: f32, color: Rgb, keeps_base: bool) -> (Rgb, Translucency) {
    let plain = |weight: f32, color: Rgb| Translucency {
        weight,
        color,
        texture: None,
        color_texture: None,
        keeps_base: false,
    };
    if !keeps_base {
        return (base, plain(weight, color));
    }
    // Scaled down to a sum of 1, as when it is rendered.
    let most = (base + weight * color).max_element().max(1.0);
    let (base, passed) = (base / most, weight * color / most);
    let (kept, through) = (base.max_element(), passed.max_element());
    let share = through / (kept + through).max(f32::MIN_POSITIVE);
    let over = |c: Rgb, part: f32| c / part.max(f32::MIN_POSITIVE);
    (over(base, 1.0 - share), plain(share, over(passed, share)))
}

/// Clips the colours of a base that transmits; true if that changes them.
fn clipped(material: &mut Material) -> bool {
    let Some(through) = material
        .finish
        .as_mut()
        .and_then(|f| f.translucency.as_mut())
    else {
        return false;
    };
    let colors = [&mut material.base_color, &mut through.color];
    let most = colors.iter().fold(0.0, |most, c| c.max_element().max(most));
    colors.into_iter().for_each(|c| *c = c.min(Rgb::ONE));
    most > 1.001
}
