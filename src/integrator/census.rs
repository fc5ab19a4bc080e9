//! How often a rule acts.

use super::walk::observer::{PathObserver, Recorder, Vertex};

/// Counts vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Vertices at which light was gathered.
    pub vertices: u64,
    /// Those of them with a roughened lobe.
    pub regularised: u64,
}

impl Census {
    /// Share of the vertices that were regularised; zero without vertices.
    pub fn share(&self) -> f64 {
        self.regularised as f64 / self.vertices.max(1) as f64
    }
}

impl PathObserver for Census {
    const VERTICES: bool = true;

    fn vertex(&mut self, vertex: &Vertex<'_>) {
        self.vertices += 1;
        self.regularised += u64::from(vertex.alpha_reg > vertex.bsdf.alpha());
    }
}

impl Recorder for Census {
    fn fork(&self) -> Self {
        Self::default()
    }

    fn join(&mut self, tile: Self) {
        self.vertices += tile.vertices;
        self.regularised += tile.regularised;
    }
}
