use super::*;

const KIND: Sealed = Sealed {
    kind: "test file",
    version: 2,
    most: 1 << 16,
};

#[test]
fn sealed_file_survives_and_any_changed_byte_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sealed");
    let header = vec!["a".to_owned(), "ü".to_owned()];
    KIND.save(&path, &header, |out| out.write_all(b"payload"))
        .unwrap();
    let load = || KIND.load::<Vec<String>>(&path);
    let stream = || -> Result<(Vec<String>, Vec<u8>), Problem> {
        let (header, mut payload) = KIND.stream(&path)?;
        let mut bytes = vec![0; payload.left() as usize];
        payload.read(&mut bytes)?;
        payload.finish()?;
        Ok((header, bytes))
    };
    assert_eq!(load().unwrap(), (header, b"payload".to_vec()));
    assert_eq!(load().unwrap(), stream().unwrap());

    let good = std::fs::read(&path).unwrap();
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 1;
        std::fs::write(&path, &bad).unwrap();
        assert!(load().is_err() && stream().is_err(), "byte {at}");
        std::fs::write(&path, &good[..at]).unwrap();
        assert!(load().is_err() && stream().is_err(), "cut at {at}");
    }
    std::fs::write(&path, vec![0; 1 << 20]).unwrap();
    assert!(load().is_err());
}

#[test]
fn sealed_file_of_another_version_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sealed");
    let other = Sealed { version: 3, ..KIND };
    other.save(&path, &0, |_| Ok(())).unwrap();
    let error = KIND.load::<u32>(&path).unwrap_err().to_string();
    let expected = "not a test file of version 2: it begins with `opsr test file 3`";
    assert!(error.ends_with(expected), "{error}");
}

#[test]
#[cfg(target_os = "linux")]
fn sealed_file_without_end_is_refused() {
    assert!(KIND.load::<u32>(Path::new("/dev/zero")).is_err());
    assert!(KIND.stream::<u32>(Path::new("/dev/zero")).is_err());
}
