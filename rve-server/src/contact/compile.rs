//! From the table `[contact]` to a compiled law. The only place that maps the key `law` to a type.

use super::composed::{ComposedLaw, ExtendedHertzMindlin, ExtendedLinear, PlainHertzMindlin, PlainLinear};
use super::hertz_mindlin::HertzSprings;
use super::law::ContactLaw;
use super::linear::LinearSprings;
use super::rolling::RollingSpring;
use super::springs::Springs;
use super::table::{ContactTable, LawName};
use crate::error::DefinitionError;
use crate::space::{Discs, KernelSpace, Spheres};

/// Work to be done with the law of a table, compiled once per law.
pub trait LawVisitor<K: KernelSpace> {
    /// Result of the work.
    type Output;

    /// Does the work with the law that the table chose.
    fn visit<C: ContactLaw<K>>(self, law: C) -> Self::Output;
}

/// The laws of grains of a dimension: work is compiled for these and no others.
pub trait ContactLaws: KernelSpace {
    /// Passes the springs of Hertz and Mindlin to `visitor` where grains have them.
    ///
    /// # Errors
    /// As [`compile`](ContactTable::compile); discs have no such springs.
    fn visit_hertz_mindlin<V: LawVisitor<Self>>(
        table: &ContactTable,
        visitor: V,
    ) -> Result<V::Output, DefinitionError>;
}

impl ContactLaws for Discs {
    fn visit_hertz_mindlin<V: LawVisitor<Self>>(table: &ContactTable, _: V) -> Result<V::Output, DefinitionError> {
        Err(table.no_law_of_discs())
    }
}

impl ContactLaws for Spheres {
    fn visit_hertz_mindlin<V: LawVisitor<Self>>(
        table: &ContactTable,
        visitor: V,
    ) -> Result<V::Output, DefinitionError> {
        let springs = table.hertz_springs()?;
        Ok(if table.is_extended() {
            visitor.visit::<ExtendedHertzMindlin>(table.composed(springs))
        } else {
            visitor.visit::<PlainHertzMindlin>(table.composed(springs))
        })
    }
}

impl ContactTable {
    /// Passes the law of a validated table to `visitor`: one compiled kernel per kind of springs, with and without the parts
    /// that most scenes do without. The key `law` decides which springs are used, not the numbers that are given.
    ///
    /// # Errors
    /// A number that the springs need is missing or out of its range; springs that grains of this dimension do not have.
    pub fn compile<K: ContactLaws, V: LawVisitor<K>>(&self, visitor: V) -> Result<V::Output, DefinitionError> {
        Ok(match (self.law, self.is_extended()) {
            (LawName::Linear, false) => visitor.visit::<PlainLinear>(self.plain_linear()?),
            (LawName::Linear, true) => visitor.visit::<ExtendedLinear>(self.composed(self.linear_springs()?)),
            (LawName::HertzMindlin, _) => K::visit_hertz_mindlin(self, visitor)?,
        })
    }

    /// Whether the law needs the parts that plain laws do without: contact viscosity or rolling resistance.
    pub(crate) fn is_extended(&self) -> bool {
        self.damping > 0.0 || self.rolling_stiffness > 0.0
    }

    /// Linear springs with friction, for programs that serve nothing else.
    ///
    /// # Errors
    /// As [`compile`](Self::compile).
    pub(crate) fn plain_linear(&self) -> Result<PlainLinear, DefinitionError> {
        Ok(self.composed(self.linear_springs()?))
    }

    fn linear_springs(&self) -> Result<LinearSprings, DefinitionError> {
        Ok(LinearSprings { normal: self.normal()?, stiffness_ratio: self.tangential_ratio() })
    }

    fn hertz_springs(&self) -> Result<HertzSprings, DefinitionError> {
        Ok(HertzSprings { shear_modulus: self.grain_shear_modulus()?, poisson_ratio: self.grain_poisson_ratio()? })
    }

    /// The law on top of its springs.
    fn composed<N: Springs, const MEMORY: usize>(&self, springs: N) -> ComposedLaw<N, MEMORY> {
        ComposedLaw {
            springs,
            friction: self.friction,
            cohesion: self.cohesion,
            unloading: self.unloading.unwrap_or_default(),
            rolling: RollingSpring { stiffness: self.rolling_stiffness, friction: self.rolling_friction },
            viscosity: self.damping,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct TypeName;

    impl LawVisitor<Spheres> for TypeName {
        type Output = &'static str;

        fn visit<C: ContactLaw<Spheres>>(self, _: C) -> &'static str {
            std::any::type_name::<C>()
        }
    }

    /// A third law may have the numbers of another one.
    #[test]
    fn the_law_decides_which_springs_are_used_and_not_the_numbers_given() {
        let spheres = ContactTable::hertz_mindlin(2.9e10, 0.15, 0.5);
        let name = |table: &ContactTable| table.compile::<Spheres, _>(TypeName);
        assert_eq!(name(&spheres), Ok(std::any::type_name::<PlainHertzMindlin>()));
        let rolling = ContactTable { rolling_stiffness: 1.0, rolling_friction: 0.1, ..spheres.clone() };
        assert_eq!(name(&rolling), Ok(std::any::type_name::<ExtendedHertzMindlin>()));
        let linear = ContactTable { law: LawName::Linear, ..spheres.clone() };
        assert!(name(&linear).is_err(), "a linear law takes no springs of spheres");
        let both = ContactTable { normal_stiffness: Some(1e7), ..linear };
        assert_eq!(name(&both), Ok(std::any::type_name::<PlainLinear>()));
        let incomplete = ContactTable { poisson_ratio: None, ..spheres };
        assert!(name(&incomplete).is_err_and(|error| error.to_string().contains("poisson_ratio")));
    }

    struct Nothing;

    impl LawVisitor<Discs> for Nothing {
        type Output = ();

        fn visit<C: ContactLaw<Discs>>(self, _: C) {}
    }

    #[test]
    fn discs_have_no_springs_of_spheres() {
        let spheres = ContactTable::hertz_mindlin(2.9e10, 0.15, 0.5);
        assert_eq!(spheres.compile::<Discs, _>(Nothing), spheres.validate_for(2));
    }
}
