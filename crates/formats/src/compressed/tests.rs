//! Streams by the encoder of meshoptimizer 1.0 whose kinds do not occur in the files of `tests/data/compressed`.

use super::meshopt::{attributes, sequence, triangles};

fn bytes(hex: &str) -> Vec<u8> {
    let digit = |c: u8| (c as char).to_digit(16).expect("a digit") as u8;
    (hex.as_bytes().chunks(2))
        .map(|pair| digit(pair[0]) << 4 | digit(pair[1]))
        .collect()
}

#[test]
fn channels_of_turned_differences_are_decoded() {
    let stream = bytes(
        "a19a2a015606511560651156065115606511560651156000000000000000000000000000000000000000000000000000804222",
    );
    assert_eq!(
        stream.last(),
        Some(&0x22),
        "differences of 32 bits, turned by two"
    );
    let plain = attributes(&stream, 40, 4).expect("a stream");
    let values = plain
        .as_chunks::<4>()
        .0
        .iter()
        .map(|v| f32::from_le_bytes(*v));
    let meant = (0..40).map(|i| (i * i % 7) as f32 * 0.125 + 64.0);
    assert_eq!(values.collect::<Vec<_>>(), meant.collect::<Vec<f32>>());
    // Channels of unknown modes, and streams of wrong lengths.
    for mode in [0x03, 0x10, 0x21, 0xff] {
        let mut other = stream.clone();
        *other.last_mut().expect("bytes") = mode;
        assert_eq!(attributes(&other, 40, 4), None);
    }
    assert_eq!(attributes(&stream, 20, 4), None);
    assert_eq!(attributes(&stream, 400, 4), None);
    assert_eq!(attributes(&stream[1..], 40, 4), None);
}

#[test]
fn sequences_of_indices_are_decoded() {
    let stream = bytes("d10004048192f40105040411b08b11f791f40100000000");
    let meant = [0, 1, 2, 1_000_000, 1_000_001, 3, 4, 1_000_005, 70_000, 7];
    assert_eq!(sequence(&stream, 10).as_deref(), Some(&meant[..]));
    assert_eq!(sequence(&stream, 9), None);
    assert_eq!(sequence(&stream, 11), None);
    assert_eq!(sequence(&stream[..4], 0), None);
}

/// Triangles of all codes, after the text of the extension: new triangles, triangles at an edge with each kind of third
/// vertex, and explicit ones.
#[test]
fn triangles_of_every_code_are_decoded() {
    let table = [0u8; 16];
    let stream = |codes: &[u8], data: &[u8]| [&[0xe1], codes, data, &table].concat();
    for (codes, data, meant) in [
        // Three new vertices; then a fourth at the newest edge (0, 2).
        (&[0xf0, 0x00][..], &[][..], vec![0, 1, 2, 0, 2, 3]),
        // Vertex 0, the third of the queue, at the edge (2, 1).
        (&[0xf0, 0x12], &[], vec![0, 1, 2, 2, 1, 0]),
        // An explicit vertex, 40 more than the last; then the vertices after and before it.
        (
            &[0xf0, 0x0f, 0x0e, 0x0d],
            &[80],
            vec![0, 1, 2, 0, 2, 40, 0, 40, 41, 0, 41, 40],
        ),
        // All three corners explicit, after a restart.
        (&[0xf0, 0xfe], &[0], vec![0, 1, 2, 0, 1, 2]),
        (&[0xf0, 0xff], &[0xf1, 20, 4], vec![0, 1, 2, 10, 12, 2]),
    ] {
        let count = meant.len();
        assert_eq!(
            triangles(&stream(codes, data), count),
            Some(meant),
            "{codes:x?}"
        );
        assert_eq!(
            triangles(&stream(codes, &[data, &[0]].concat()), count),
            None
        );
    }
    // An edge that was never written, a code that does not exist, a table of invalid codes, and a wrong first byte.
    assert_eq!(triangles(&stream(&[0x00], &[]), 3), None);
    assert_eq!(triangles(&stream(&[0xf0, 0x50], &[]), 6), None);
    assert_eq!(
        triangles(&[&[0xe1, 0xf0][..], &[0xf0; 16]].concat(), 3),
        None
    );
    assert_eq!(triangles(&[&[0xe0, 0xf0][..], &table].concat(), 3), None);
}
