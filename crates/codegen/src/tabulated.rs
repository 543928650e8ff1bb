//! Fields that a file takes from the table beside it, because they follow from the history of each particle.

use crate::code::Code;
use crate::listing::Item;
use crate::names::Names;
use crate::table::{OfTable, Tabulated};
use crate::text::digits;
use mmsmith_spec::Surface;
use mmsmith_stage::{FieldName, Shape};

impl Code<'_> {
    /// This code with the table beside it.
    #[must_use]
    pub fn with_table(mut self, table: Tabulated) -> Self {
        self.table = Some(table);
        self
    }

    /// How many internal variables there are.
    pub(crate) fn variable_count(&self) -> usize {
        self.table.as_ref().map_or(0, |table| table.variables.len())
    }

    /// The name of the table's file.
    pub(crate) fn table_file(&self) -> String {
        format!("{}.table", Names::of(&self.spec.name).module)
    }

    /// Whether a field is taken from the table.
    pub(crate) fn is_tabulated(&self, field: FieldName) -> bool {
        self.table.is_some()
            && matches!(field, FieldName::FirstPiolaKirchhoff | FieldName::BodyForce)
    }

    /// The surfaces whose tractions the file has.
    pub(crate) fn surfaces(&self) -> Vec<Surface> {
        match &self.table {
            None => self.staged.tractions.iter().map(|traction| traction.surface).collect(),
            Some(_) => self.spec.domain.surfaces(self.spec.dimension),
        }
    }

    /// The functions that take their values from the table, after the fields.
    pub(crate) fn tabulated_items(&self) -> Vec<Item> {
        let Some(table) = &self.table else { return Vec::new() };
        let about = format!("all internal variables: {}", table.variables.join(", "));
        let mut items = Vec::new();
        if !table.variables.is_empty() {
            items.push(Item::of_table("internal".into(), about, Shape::Vector, OfTable::Internal));
        }
        let mut taken: Vec<String> = Vec::new();
        for (variable, place) in table.places() {
            // Some languages do not tell small letters from capital ones.
            let mut name: String = format!("internal_{variable}").chars().take(55).collect();
            while taken.iter().any(|other| other.eq_ignore_ascii_case(&name)) {
                name.push('_');
            }
            taken.push(name.clone());
            let about = format!("the internal variable {variable}");
            items.push(Item::of_table(name, about, Shape::Scalar, place));
        }
        items.extend(self.surfaces().into_iter().map(|surface| {
            let name = surface.to_string();
            let about = format!("traction on the surface {name}, force per reference area");
            let name = format!("{}_traction", name.replace('-', "_"));
            Item::of_table(name, about, Shape::Vector, OfTable::Traction(surface))
        }));
        items
    }

    /// Messages of a file: there is no table, it is another one, it is not whole.
    pub(crate) fn table_messages(&self) -> [String; 3] {
        let (file, name) = (self.table_file(), &self.spec.name);
        [
            format!(
                "the table {file} of {name} cannot be opened; it lies beside this source, give its path"
            ),
            format!(
                "{file} is the table of another source; write both anew by one call of mms gen {name}"
            ),
            format!("{file} is no whole table of mms gen; write it anew by mms gen {name}"),
        ]
    }

    /// Lines on the table for the head of a file.
    pub(crate) fn about_table(&self) -> Vec<String> {
        let Some(table) = &self.table else { return Vec::new() };
        let values: Vec<String> =
            self.spec.parameters.iter().map(|p| format!("{} = {}", p.name, p.default)).collect();
        let where_it_holds = match table.in_time {
            Some(_) => "at all positions of the body",
            None => "at the points that were given to mms gen alone, and nowhere else",
        };
        let components = match self.is_of_half_plane {
            true => "the components 1, 2 and 3 along R, theta and Z",
            false => "Cartesian components",
        };
        vec![format!(
            "table: P, b, tractions and internal variables ({}) follow from the history of each particle and come from the file {} beside this one, \
             {where_it_holds}, with errors of about {:.1e} of the largest value of each. It holds for {}, and for times from 0 to {}: later ones give \
             not a number. For other values write both files anew, mms gen {} --set NAME=VALUE --periods X. The state at the start, which a host \
             sets, is that of t = 0. Tensors among the internal variables have {components}.",
            table.variables.join(", "),
            self.table_file(),
            table.error,
            values.join(", "),
            digits(table.end),
            self.spec.name,
        )]
    }
}
