//! Names of the parameters that the readers accept. Any other name is an error, as in pbrt and Mitsuba: a misspelt
//! parameter would silently keep its default.

use super::Context;
use opsr::scene::load::Unsupported;
use opsr::scene::load::error::{Result, fault};

/// Parameters of some kinds of an element such as `Material` or `bsdf`; names are separated by spaces.
pub(super) struct Names {
    pub(super) element: &'static str,
    /// Kinds, or [`ALL`] for the parameters of every kind of the element.
    pub(super) kinds: &'static str,
    /// Parameters that are read.
    pub(super) read: &'static str,
    /// Parameters without effect here, such as those of sampling and of output files.
    pub(super) idle: &'static str,
    /// Parameters that change the picture but are not read: they cause a warning.
    pub(super) left: &'static str,
}

/// Marks parameters of all kinds.
pub(super) const ALL: &str = "*";

/// A row of a table of names.
pub(super) const fn row(
    element: &'static str,
    kinds: &'static str,
    read: &'static str,
    idle: &'static str,
    left: &'static str,
) -> Names {
    Names {
        element,
        kinds,
        read,
        idle,
        left,
    }
}

fn has(list: &str, name: &str) -> bool {
    list.split(' ').any(|word| word == name)
}

impl Context {
    /// Checks the names of an element's parameters, given with their places. Kinds that are not in the table pass: they
    /// are refused where they are used.
    pub(super) fn check_names<'n>(
        &mut self,
        table: &[Names],
        (element, kind): (&str, &str),
        given: impl IntoIterator<Item = (&'n str, &'n str)>,
    ) -> Result<()> {
        let of_element = table.iter().filter(|row| row.element == element);
        let rows: Vec<&Names> = of_element
            .filter(|row| row.kinds == ALL || has(row.kinds, kind))
            .collect();
        if rows.iter().all(|row| row.kinds == ALL) {
            return Ok(());
        }
        for (name, place) in given {
            let in_one = |list: fn(&Names) -> &'static str| {
                // An empty list, when split, has one empty name.
                !name.is_empty() && rows.iter().any(|row| has(list(row), name))
            };
            if in_one(|row| row.read) || in_one(|row| row.idle) {
                continue;
            }
            if in_one(|row| row.left) {
                self.approximate(place, &format!("`{name}` of `{kind}` is not taken"));
                continue;
            }
            let lists = rows.iter().flat_map(|row| [row.read, row.left]);
            let known = lists.flat_map(|list| list.split(' '));
            let known: Vec<&str> = known.filter(|name| !name.is_empty()).collect();
            let only = match known.as_slice() {
                [] => String::new(),
                some => format!(", only {}", some.join(", ")),
            };
            let what = format!("`{kind}` has no parameter `{name}`{only}");
            match self.unsupported == Unsupported::Skip {
                true => self.approximate(place, &what),
                false => {
                    let what = format!("{what}; --unsupported skip goes on without it");
                    return Err(fault(place, what));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{mitsuba, pbrt};

    /// Every name in a list of read parameters occurs in the source of the reader, and in no other list.
    #[test]
    fn names_are_read_as_their_tables_say() {
        let of_pbrt = [
            include_str!("pbrt/lights.rs"),
            include_str!("pbrt/mappings.rs"),
            include_str!("pbrt/materials.rs"),
            include_str!("pbrt/media.rs"),
            include_str!("pbrt/mod.rs"),
            include_str!("pbrt/older.rs"),
            include_str!("pbrt/shapes.rs"),
            include_str!("pbrt/values.rs"),
        ];
        let of_mitsuba = [
            include_str!("mitsuba/bsdfs.rs"),
            include_str!("mitsuba/lights.rs"),
            include_str!("mitsuba/media.rs"),
            include_str!("mitsuba/shapes.rs"),
            include_str!("mitsuba/values.rs"),
        ];
        for (table, source) in [
            (pbrt::names::NAMES, of_pbrt.concat()),
            (mitsuba::names::NAMES, of_mitsuba.concat()),
        ] {
            assert!(table.len() > 30);
            for row in table {
                let of = |list: &'static str| list.split(' ').filter(|name| !name.is_empty());
                for name in of(row.read) {
                    // The readers put prefixes of layers before some names.
                    let last = name.rsplit('.').next().unwrap_or(name);
                    let asked = [
                        format!("\"{name}\""),
                        format!("\"{last}\""),
                        format!("}}{last}\""),
                    ];
                    let found = asked.iter().any(|asked| source.contains(asked));
                    assert!(found, "{} {}: `{name}`", row.element, row.kinds);
                }
                let mut all: Vec<_> = [row.read, row.idle, row.left]
                    .into_iter()
                    .flat_map(of)
                    .collect();
                let count = all.len();
                all.sort_unstable();
                all.dedup();
                assert_eq!(all.len(), count, "{} {}", row.element, row.kinds);
            }
        }
    }
}
