//! All integration tests, in one binary so that the library is linked once.

mod agree;
mod architecture;
mod backs;
mod bench;
mod bidirectional;
mod boundaries;
mod bsdf;
mod chaos;
mod circles;
mod clearcoat;
mod cli;
mod compare;
mod energy;
mod examples;
mod export;
mod exr;
mod foreign;
mod fuzz;
mod guided;
mod load;
mod manifold;
mod metric;
mod mollifier;
mod nested;
mod opacity;
mod options;
mod panes;
mod parts;
#[cfg(feature = "train")]
mod readme;
mod references;
mod resume;
mod scenes;
mod stability;
#[cfg(feature = "train")]
mod stability_train;
mod support;
mod table_file;
#[cfg(feature = "train")]
mod train;
mod training_scenes;
mod transport;
mod view;
mod witness;
mod words;

use opsr_lab as lab;
