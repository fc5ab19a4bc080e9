use super::*;

#[test]
fn denoiser_is_looked_for_in_the_named_folder_first() {
    let files = candidates(Some(Path::new("/opt/oidn")), &[]);
    assert_eq!(files[0], Path::new("/opt/oidn/lib").join(NAMES[0]));
    assert_eq!(files.last(), NAMES.last().map(PathBuf::from).as_ref());
    assert_eq!(candidates(None, &[]).len(), NAMES.len());
}

#[test]
fn denoiser_is_found_in_a_python_package() {
    let environment = tempfile::tempdir().expect("a folder");
    let none = candidates(None, &[environment.path().to_owned()]);
    assert_eq!(none, candidates(None, &[]));
    let package = environment.path().join("lib/python3.12/site-packages");
    let library = package.join(PACKAGE).join("lib");
    std::fs::create_dir_all(&library).expect("a folder");
    let files = candidates(None, &[environment.path().to_owned()]);
    assert_eq!(files[NAMES.len()], library.join(NAMES[0]));
    // The folder that the user names and the system's library come first.
    let named = candidates(
        Some(Path::new("/opt/oidn")),
        &[environment.path().to_owned()],
    );
    assert!(named.ends_with(&files) && named.len() > files.len());
}

/// If the library is installed: noise of a constant is removed, and an edge in the albedo stays.
#[test]
fn denoiser_removes_noise_and_keeps_edges() {
    let Ok(denoiser) = Denoiser::open() else {
        eprintln!("skipped: no Open Image Denoise; set {VARIABLE}");
        return;
    };
    let half = |x: usize| if x < 32 { 0.2f32 } else { 0.8 };
    let hash = |x: usize, y: usize| ((x * 7919 + y * 104_729) % 1009) as f32 / 1009.0;
    let noisy = Buffer::from_fn(64, 64, |x, y| {
        Rgb::splat(half(x) * (0.5 + hash(x * x + y, y * y + x)))
    });
    let albedo = Buffer::from_fn(64, 64, |x, _| Rgb::splat(half(x)));
    let normal = Buffer::from_fn(64, 64, |_, _| Rgb::Z);
    let clean = denoiser
        .denoise(&noisy, &albedo, &normal)
        .expect("denoised");
    assert_eq!(
        clean,
        denoiser.denoise(&noisy, &albedo, &normal).expect("again")
    );
    let error = |b: &Buffer| -> f32 {
        let pixels = b.pixels.iter().enumerate();
        let one = |(i, p): (usize, &Rgb)| (p.x - half(i % 64)).powi(2);
        pixels.map(one).sum()
    };
    assert!(
        error(&clean) < 0.2 * error(&noisy),
        "{} {}",
        error(&clean),
        error(&noisy)
    );
}
