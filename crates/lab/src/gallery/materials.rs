//! Materials by their most common parameters.

use opsr::math::Rgb;
use opsr::scene::Material;
use opsr::scene::finish::{Anisotropy, Clearcoat, Translucency};

/// Reflectance of gold at normal incidence, linear.
pub const GOLD: Rgb = Rgb::new(1.0, 0.78, 0.34);
/// Reflectance of copper.
pub const COPPER: Rgb = Rgb::new(0.95, 0.64, 0.54);
/// Reflectance of silver.
pub const SILVER: Rgb = Rgb::new(0.96, 0.96, 0.96);
/// Reflectance of aluminium.
pub const ALUMINIUM: Rgb = Rgb::new(0.91, 0.92, 0.92);
/// Approximate reflectance of iron.
pub const IRON: Rgb = Rgb::new(0.56, 0.57, 0.58);

fn base(name: &str, base_color: Rgb, alpha: f32) -> Material {
    Material {
        name: name.to_owned(),
        base_color,
        metallic: 0.0,
        alpha,
        ..Material::default()
    }
}

/// A Lambertian surface: a dielectric without its coat.
pub fn diffuse(name: &str, albedo: Rgb) -> Material {
    Material {
        specular: 0.0,
        ..base(name, albedo, 1.0)
    }
}

/// A metal with reflectance `f0` at normal incidence.
pub fn metal(name: &str, f0: Rgb, alpha: f32) -> Material {
    Material {
        metallic: 1.0,
        ..base(name, f0, alpha)
    }
}

/// A Lambertian base under a dielectric coat.
pub fn coated(name: &str, albedo: Rgb, alpha: f32) -> Material {
    base(name, albedo, alpha)
}

/// A material under a clear coat of roughness `alpha`.
pub fn clearcoated(mut base: Material, alpha: f32) -> Material {
    base.finish_mut().clearcoat = Some(Clearcoat {
        weight: 1.0,
        alpha,
        ..Clearcoat::default()
    });
    base
}

/// A material brushed with this strength, rougher along the direction at the angle `rotation` from the tangent.
pub fn brushed(mut base: Material, strength: f32, rotation: f32) -> Material {
    base.finish_mut().anisotropy = Some(Anisotropy {
        strength,
        rotation,
        texture: None,
    });
    base
}

/// A material whose base transmits the share `weight` diffusely, in the colour `transmitted`. Cameras see both sides.
pub fn translucent(mut base: Material, weight: f32, transmitted: Rgb) -> Material {
    base.finish_mut().translucency = Some(Translucency {
        weight,
        color: transmitted,
        texture: None,
        color_texture: None,
        keeps_base: false,
    });
    base.double_sided = true;
    base
}

/// The boundary of a solid transparent body.
pub fn glass(name: &str, ior: f32, alpha: f32) -> Material {
    Material {
        transmission: 1.0,
        ior,
        solid: true,
        ..base(name, Rgb::ONE, alpha)
    }
}

/// Glass that absorbs along the way, `absorption` per unit length.
pub fn tinted_glass(name: &str, ior: f32, alpha: f32, absorption: Rgb) -> Material {
    Material {
        absorption,
        ..glass(name, ior, alpha)
    }
}

/// A surface that emits `radiance` from its front and reflects nothing.
pub fn emitter(name: &str, radiance: Rgb) -> Material {
    Material {
        emission: radiance,
        ..diffuse(name, Rgb::ZERO)
    }
}
