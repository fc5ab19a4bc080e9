//! Directions from a mixture of BSDF and guide, and the training records of a path.

use super::field::{Field, Leaf, Record};
use crate::bsdf::{BsdfSample, Lobe, SharedNumbers};
use crate::integrator::path::directions::Directions;
use crate::integrator::walk::Interaction;
use crate::integrator::walk::roughening::{roughen, scattered};
use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::math::{Rgb, Vec2, Vec3, luminance};
use crate::regularise::rules::RulePath;
use crate::regularise::{Roughening, Rule};
use crate::sampler::{Sampler, VertexU};

/// Roughness below which a lobe is not guided: the density of a sharp lobe is better than any quadtree, and in chains
/// of such lobes most draws from the guide miss.
const SHARP: f32 = 0.3;

/// The density from which a vertex draws the next direction: that of the BSDF, or a mixture with that of the guide
/// where the guide has one.
#[derive(Clone, Copy)]
struct Mixture<'a> {
    region: Option<&'a Leaf>,
    /// Probability of a draw from the BSDF.
    share: f32,
}

impl Mixture<'_> {
    /// Density of a world direction, whose density in the BSDF is `pdf_w`.
    #[inline]
    fn pdf(&self, wi: Vec3, pdf_w: f32) -> f32 {
        match self.region {
            Some(region) if self.share < 1.0 => {
                self.share * pdf_w + (1.0 - self.share) * region.tree.pdf(wi)
            }
            _ => pdf_w,
        }
    }

    /// Draws a direction; also returns its densities in the BSDF and in the tree.
    #[inline]
    fn sample(
        &self,
        point: &ShadingPoint<'_>,
        alpha: f32,
        lobe: &SharedNumbers,
        u: [f32; 4],
    ) -> Option<(Continuation, [f32; 2])> {
        let Some(region) = self.region else {
            let next = point.sample(alpha, lobe)?;
            let pdf_w = next.sample.pdf_w;
            return Some((next, [pdf_w, 0.0]));
        };
        let (next, tree) = if u[0] < self.share {
            let next = point.sample(alpha, lobe)?;
            if next.sample.delta {
                let mut sample = next.sample;
                sample.weight /= self.share;
                return Some((Continuation { sample, ..next }, [0.0; 2]));
            }
            let tree = region.tree.pdf(next.wi);
            (next, tree)
        } else {
            let (dir, pdf) = region.tree.sample(Vec2::new(u[1], u[2]));
            let wi = point.frame.to_local(dir);
            if !point.surface.allows_direction(dir, wi.z) {
                return None;
            }
            let query = point.bsdf.query(point.wo, wi)?;
            let eval = query.at(alpha);
            // The lobe from which the BSDF would have drawn the direction, with the same probability.
            let lobe = if u[3] * eval.pdf_w < query.base_pdf {
                Lobe::Diffuse
            } else if wi.z * point.wo.z > 0.0 {
                Lobe::Reflection
            } else {
                Lobe::Transmission
            };
            let sample = BsdfSample {
                wi,
                value: eval.value,
                weight: Rgb::ZERO,
                pdf_w: eval.pdf_w,
                lobe,
                delta: false,
            };
            (Continuation { wi: dir, sample }, pdf)
        };
        let mut sample = next.sample;
        let pdfs = [sample.pdf_w, tree];
        sample.pdf_w = self.share * sample.pdf_w + (1.0 - self.share) * tree;
        if sample.pdf_w <= 0.0 || sample.value == Rgb::ZERO {
            return None;
        }
        sample.weight = sample.value / sample.pdf_w;
        Some((Continuation { sample, ..next }, pdfs))
    }
}

/// A vertex whose record is open until the path is complete.
struct OpenRecord {
    record: Record,
    /// Density of the direction.
    pdf_w: f32,
    weight: Rgb,
    /// Throughput beyond the vertex.
    throughput: Rgb,
    /// Contributions beyond it, before the next record.
    found: Rgb,
}

/// Training records of the guide from the paths of a tile.
#[derive(Default)]
pub(super) struct TrainingSamples {
    pub(super) records: Vec<Record>,
    path: Vec<OpenRecord>,
}

impl TrainingSamples {
    /// Adds a contribution to all open records.
    fn found(&mut self, value: Rgb) {
        if let Some(last) = self.path.last_mut() {
            last.found += value;
        }
    }

    /// Closes the records of a path.
    fn finish(&mut self) {
        let mut beyond = Rgb::ZERO;
        while let Some(open) = self.path.pop() {
            beyond += open.found;
            let radiance = Rgb::select(
                open.throughput.cmpgt(Rgb::ZERO),
                beyond / open.throughput,
                Rgb::ZERO,
            );
            let mut record = open.record;
            record.value = luminance(radiance) / open.pdf_w;
            record.scattered = luminance(radiance * open.weight);
            if record.value.is_finite() && record.scattered.is_finite() {
                self.records.push(record);
            }
        }
    }
}

/// A rule for the training only: the guide learns the light of roughened vertices, while the picture is not roughened.
struct LearningRule<'a> {
    rule: &'a Rule,
    memory: RulePath,
}

/// The current vertex of a path.
struct Site<'a> {
    mixture: Mixture<'a>,
    /// True if the guide may draw here, and learns from here.
    guided: bool,
    /// Extent of the region around it.
    edges: Vec3,
    /// Class of the vertex, for the choice of a share.
    class: u8,
    /// Random numbers of the next direction.
    u: [f32; 4],
    /// Densities of that direction in the BSDF and in the tree.
    pdfs: [f32; 2],
}

/// Directions of one path, from the BSDF or the guide.
pub(super) struct Guide<'a> {
    field: &'a Field,
    /// Records of the path; `None` if it is not recorded.
    training: Option<&'a mut TrainingSamples>,
    learning: Option<LearningRule<'a>>,
    site: Option<Site<'a>>,
    /// False if the roughened lobe of `learning` has recorded the light of the current vertex and of its next edge.
    records: bool,
}

impl<'a> Guide<'a> {
    /// Directions of the path of sample number `sample`. `rule`, if there is one, is for the training only.
    pub(super) fn new(
        field: &'a Field,
        training: Option<&'a mut TrainingSamples>,
        rule: Option<&'a Rule>,
        sample: u32,
    ) -> Self {
        let learning = rule.map(|rule| LearningRule {
            rule,
            memory: rule.start(sample),
        });
        Self {
            field,
            training,
            learning,
            site: None,
            records: true,
        }
    }

    /// Records light of a vertex that the training rule roughens; returns true if it does.
    fn learn_roughened(&mut self, point: &ShadingPoint<'_>, u: &VertexU) -> bool {
        let Some(LearningRule { rule, memory }) = &self.learning else {
            return false;
        };
        let alpha_reg = roughen(*rule, memory, point.alpha);
        // Light through a pane counts at the previous vertex.
        if alpha_reg <= point.alpha || point.is_pane() {
            return false;
        }
        if let Some(training) = self.training.as_deref_mut() {
            let rough = ShadingPoint {
                alpha_reg,
                ..*point
            };
            training.found(rough.direct_light(u.light, &mut ()));
            training.found(rough.roughened_emission(&SharedNumbers::new(u.lobe), &mut ()));
        }
        true
    }
}

impl Directions for Guide<'_> {
    fn arrive(&mut self, point: &ShadingPoint<'_>, u: &VertexU, sampler: &mut impl Sampler) {
        let v = std::array::from_fn(|_| sampler.next_1d());
        let ShadingPoint { bsdf, alpha, .. } = *point;
        // A surface with a diffuse base is guided, however sharp its glossy lobe is.
        let guided = alpha >= SHARP && !bsdf.is_delta_at(alpha) || !bsdf.is_delta_at(0.0);
        let (leaf, edges) = if guided {
            self.field.leaf(point.surface.position)
        } else {
            (0, Vec3::ZERO)
        };
        let region = self.field.region(leaf);
        let class = u8::from(!bsdf.is_diffuse());
        let share = region.shares[usize::from(class)];
        // If no direction is drawn from the tree, only the training needs its density.
        let asked = guided && (share < 1.0 || self.training.is_some());
        self.site = Some(Site {
            mixture: Mixture {
                region: (asked && !region.tree.is_empty()).then_some(region),
                share,
            },
            guided,
            edges,
            class,
            u: v,
            pdfs: [0.0; 2],
        });
        self.records = !self.learn_roughened(point, u);
    }

    #[inline]
    fn pdf(&self, wi: Vec3, pdf_w: f32) -> f32 {
        self.site
            .as_ref()
            .map_or(pdf_w, |site| site.mixture.pdf(wi, pdf_w))
    }

    fn sample(
        &mut self,
        point: &ShadingPoint<'_>,
        alpha: f32,
        u: &SharedNumbers,
    ) -> Option<Continuation> {
        let site = self.site.as_mut()?;
        let (next, pdfs) = site.mixture.sample(point, alpha, u, site.u)?;
        site.pdfs = pdfs;
        Some(next)
    }

    fn found(&mut self, value: Rgb) {
        if let Some(training) = self.training.as_deref_mut().filter(|_| self.records) {
            training.found(value);
        }
    }

    fn met(&mut self, value: Rgb) {
        self.found(value);
    }

    fn leave(
        &mut self,
        vertex: &Interaction<'_>,
        next: &Continuation,
        throughput: Rgb,
        sampler: &mut impl Sampler,
    ) {
        if let Some(LearningRule { rule, memory }) = &mut self.learning {
            rule.scatter(memory, scattered(vertex.alpha, &next.sample));
        }
        let Some((training, site)) = self.training.as_deref_mut().zip(self.site.as_ref()) else {
            return;
        };
        if !site.guided || next.sample.delta {
            return;
        }
        let jitter = Vec3::from_array(std::array::from_fn(|_| sampler.next_1d() - 0.5));
        let turn = Vec2::new(sampler.next_1d() - 0.5, sampler.next_1d() - 0.5);
        let position = vertex.surface.position;
        let (leaf, at) = self
            .field
            .blurred(position, site.edges * jitter, next.wi, turn);
        training.path.push(OpenRecord {
            record: Record {
                leaf,
                at,
                value: 0.0,
                scattered: 0.0,
                pdfs: site.pdfs,
                class: site.class,
            },
            pdf_w: next.sample.pdf_w,
            weight: next.sample.weight,
            throughput,
            found: Rgb::ZERO,
        });
    }

    fn finish(&mut self) {
        if let Some(training) = self.training.as_deref_mut() {
            training.finish();
        }
    }
}
