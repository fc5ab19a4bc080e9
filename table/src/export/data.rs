//! Arrays and text: NumPy, safetensors and CSV.

use crate::file::{ORDER, TableFile};
use crate::{BINS, GammaIndex, LEN};
use std::fmt::Write;

/// Factors multiplied by the scale, in class order.
fn factors(file: &TableFile) -> impl Iterator<Item = (GammaIndex, f32)> {
    let classes = (0..LEN).filter_map(GammaIndex::new);
    classes.map(|class| (class, file.table.factor(class)))
}

fn bytes(file: &TableFile) -> impl Iterator<Item = u8> {
    factors(file).flat_map(|(_, gamma)| gamma.to_le_bytes())
}

/// NumPy's format, version 1.0: magic, length of the header, the header as a Python dictionary, the factors.
pub(super) fn npy(file: &TableFile) -> Vec<u8> {
    /// Magic, version and length of the header.
    const FIXED: usize = 10;
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({LEN},), }}");
    // The factors begin at a multiple of 64 bytes; a line feed ends the header.
    let padded = (FIXED + header.len() + 1).next_multiple_of(64) - FIXED;
    header = format!("{header:<width$}\n", width = padded - 1);
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(bytes(file));
    out
}

/// Safetensors: length of the header, the header as JSON, the factors. The crate `safetensors` keeps metadata in a hash map,
/// whose order changes from run to run; the same table must give the same bytes.
pub(super) fn safetensors(file: &TableFile) -> Vec<u8> {
    let table = &file.table;
    let mut metadata = serde_json::json!({
        "order": ORDER,
        "levels": BINS.to_string(),
        "lookup": table.lookup,
        "scale_applied": format!("{:?}", table.scale),
    });
    if let Some(p) = &file.provenance {
        metadata["beta"] = p.beta.to_string().into();
        metadata["spp"] = p.spp.to_string().into();
        metadata["loss"] = p.loss.as_str().into();
        metadata["model"] = p.model.as_str().into();
        metadata["opsr"] = p.opsr.as_str().into();
    }
    let header = serde_json::json!({
        "__metadata__": metadata,
        "gammas": { "dtype": "F32", "shape": [LEN], "data_offsets": [0, 4 * LEN] },
    });
    let mut header = header.to_string();
    // Spaces align the factors to 8 bytes.
    header.push_str(&" ".repeat(header.len().next_multiple_of(8) - header.len()));
    let mut out = (header.len() as u64).to_le_bytes().to_vec();
    out.extend(header.as_bytes());
    out.extend(bytes(file));
    out
}

/// One line per class: index, number of vertices, base-4 code of the bins, bins, factor, visits (empty if unknown).
pub(super) fn csv(file: &TableFile) -> String {
    let mut out = String::from("index,length,code,bins,gamma,visits\n");
    for (class, gamma) in factors(file) {
        let bins = class.bins();
        let code = bins.iter().fold(0, |code, &bin| code * BINS + bin);
        let words: Vec<String> = bins.iter().map(usize::to_string).collect();
        let visits = (file.provenance.as_ref()).and_then(|p| p.visits.get(class.index()));
        let visits = visits.map(u64::to_string).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{},{},{code},{},{gamma:?},{visits}",
            class.index(),
            bins.len(),
            words.join(" "),
        );
    }
    out
}
