//! One reciprocal for several quotients of the same denominator.
//!
//! A processor starts a product every half cycle but a quotient only every four or more. Where a program divides more
//! than once by one quantity or by powers of it, as polar fields divide by `R`, `R^2` and `R^3`, one reciprocal is
//! formed, and the quotients become products with its powers. Each such product carries one rounding more than the
//! quotient had, the same for small and for large values.
//!
//! In the same way a product whose logarithm is taken, as J is, serves for the reciprocals of its factors, as the stretches along
//! axes are: `1/a = b/(a b)`. That it neither overflows nor vanishes its logarithm asks for already.

use crate::program::Builder;
use crate::{Operation, Program, Rational, Rule, Slot};
use num_integer::Integer;
use num_traits::One;
use std::collections::{BTreeMap, BTreeSet};

/// A quantity and the power of it that some slot holds.
type Power = (Slot, u32);

/// Power of a quantity whose reciprocal is formed.
#[derive(Clone, Copy)]
enum Unit {
    /// The power of the quantity that a slot holds: the greatest of which all denominators are powers, where it is at hand.
    Slot(Slot, u32),
    /// The square of the quantity, which is a square root.
    Root,
}

impl Program {
    /// The program with shared reciprocals, and without operations that no output needs.
    pub(crate) fn with_shared_reciprocals(&self) -> Program {
        if Rule::Reciprocals.is_off() {
            return self.compacted();
        }
        self.with_reciprocals_of_powers().with_reciprocals_of_factors()
    }

    /// One reciprocal of each quantity that several quotients divide by powers of.
    fn with_reciprocals_of_powers(&self) -> Program {
        let shared = self.shared_divisors();
        if shared.is_empty() {
            return self.compacted();
        }
        let powers = self.powers();
        let mut builder = Builder::default();
        let mut places: Vec<Option<Slot>> = vec![None; self.operations().len()];
        for slot in self.slots() {
            let operation = &self.operations()[slot.index()];
            let quotient = self.divisor(slot, &powers);
            let quotient = quotient.and_then(|(base, n)| Some((base, n, *shared.get(&base)?)));
            let place = |slot: Slot| places[slot.index()].unwrap_or(slot);
            let moved = match (quotient, operation) {
                (Some((base, n, unit)), &Operation::Div(numerator, _)) => {
                    let factor = match (unit, &self.operations()[base.index()]) {
                        (Unit::Slot(divisor, power), _) => {
                            let reciprocal = reciprocal_of(&mut builder, place(divisor));
                            builder.power(reciprocal, n / power)
                        }
                        // R/R^2 is ready sooner than 1/R, as the quotient need not wait for the root.
                        (Unit::Root, &Operation::Sqrt(square)) => {
                            let square = place(square);
                            let reciprocal = reciprocal_of(&mut builder, square);
                            let even = builder.power(reciprocal, n / 2);
                            if n.is_multiple_of(2) {
                                even
                            } else {
                                let root = builder.push(Operation::Sqrt(square));
                                let odd = builder.times(root, reciprocal);
                                if n == 1 { odd } else { builder.times(even, odd) }
                            }
                        }
                        (Unit::Root, _) => reciprocal_of(&mut builder, place(base)),
                    };
                    let is_one = self.is_one(numerator);
                    times_reciprocal(&mut builder, place(numerator), is_one, factor)
                }
                _ => builder.push_input(operation.with_operands(place), self.dependence(slot)),
            };
            places[slot.index()] = Some(moved);
        }
        let outputs = self.outputs().iter().filter_map(|slot| places[slot.index()]).collect();
        builder.program(outputs).compacted()
    }

    fn is_one(&self, slot: Slot) -> bool {
        self.operations()[slot.index()] == Operation::Number(Rational::one())
    }

    /// One reciprocal of a product whose logarithm is taken, for the quotients by its factors, in a program without
    /// operations that no output needs.
    fn with_reciprocals_of_factors(self) -> Program {
        let product = |slot: Slot| match self.operations()[slot.index()] {
            Operation::LnOfBoth(_, product) => Some(product),
            _ => None,
        };
        let products: BTreeSet<Slot> = self.slots().filter_map(product).collect();
        // One is enough: there is one J.
        let cheaper = products.into_iter().find_map(|p| self.with_reciprocals_of_factors_of(p));
        cheaper.unwrap_or(self)
    }

    /// `None` where quotients divide by fewer than two of the product and its factors.
    fn with_reciprocals_of_factors_of(&self, whole: Slot) -> Option<Program> {
        let factors = self.factors(whole);
        let divisors: BTreeSet<Slot> =
            factors.iter().map(|(factor, ..)| *factor).chain([whole]).collect();
        let before = self.needed(&[whole]);
        let quotient = |slot: Slot| match self.operations()[slot.index()] {
            Operation::Div(numerator, factor)
                if divisors.contains(&factor) && !before[slot.index()] =>
            {
                Some((numerator, factor))
            }
            _ => None,
        };
        let divided: BTreeSet<Slot> =
            self.slots().filter_map(quotient).map(|(_, factor)| factor).collect();
        if divided.len() < 2 {
            return None;
        }
        let mut builder = Builder::default();
        let mut places: Vec<Option<Slot>> = vec![None; self.operations().len()];
        let mut reciprocals: BTreeMap<Slot, Slot> = BTreeMap::new();
        // What the product needs comes first, since the quotients need it now.
        let first = self.slots().filter(|slot| before[slot.index()]);
        for slot in first.chain(self.slots().filter(|slot| !before[slot.index()])) {
            let operation = &self.operations()[slot.index()];
            let place = |slot: Slot| places[slot.index()].unwrap_or(slot);
            let own = self.dependence(slot);
            let moved = if let Some((numerator, factor)) = quotient(slot) {
                if reciprocals.is_empty() {
                    reciprocals.insert(whole, reciprocal_of(&mut builder, place(whole)));
                    for &(factor, product, other) in &factors {
                        let of_factor = Operation::Mul(place(other), *reciprocals.get(&product)?);
                        reciprocals.insert(factor, builder.push(of_factor));
                    }
                }
                let reciprocal = *reciprocals.get(&factor)?;
                times_reciprocal(&mut builder, place(numerator), self.is_one(numerator), reciprocal)
            } else {
                builder.push_input(operation.with_operands(place), own)
            };
            places[slot.index()] = Some(moved);
        }
        let outputs = self.outputs().iter().filter_map(|slot| places[slot.index()]).collect();
        Some(builder.program(outputs).compacted())
    }

    /// The factors of a product, and theirs, as far as they have its rate: each with the product that it is a factor of, which
    /// comes earlier, and with the other factor.
    fn factors(&self, whole: Slot) -> Vec<(Slot, Slot, Slot)> {
        let rate = self.dependence(whole);
        let (mut factors, mut seen, mut products) = (Vec::new(), BTreeSet::new(), vec![whole]);
        while let Some(product) = products.pop() {
            let Operation::Mul(a, b) = self.operations()[product.index()] else { continue };
            let same_rate = [a, b].iter().all(|&factor| self.dependence(factor) == rate);
            // A product may be a factor of several.
            if a != b && same_rate && seen.insert(product) {
                factors.extend([(a, product, b), (b, product, a)]);
                products.extend([a, b]);
            }
        }
        factors
    }

    /// The quantities that several needed quotients divide by powers of, with the reciprocal to form.
    fn shared_divisors(&self) -> BTreeMap<Slot, Unit> {
        let powers = self.powers();
        let needed = self.needed(self.outputs());
        let mut quotients: BTreeMap<Slot, Vec<(Slot, u32)>> = BTreeMap::new();
        for slot in self.slots().filter(|slot| needed[slot.index()]) {
            if let Some((base, power)) = self.divisor(slot, &powers) {
                quotients.entry(base).or_default().push((slot, power));
            }
        }
        quotients.retain(|_, quotients| quotients.len() > 1);
        let unit_of = |(base, quotients): (Slot, Vec<(Slot, u32)>)| {
            if matches!(self.operations()[base.index()], Operation::Sqrt(_)) {
                return (base, Unit::Root);
            }
            let unit = quotients.iter().fold(0, |unit: u32, (_, power)| unit.gcd(power));
            let first = quotients[0].0;
            let at_hand =
                powers.iter().find(|(slot, power)| **power == (base, unit) && **slot < first);
            (base, at_hand.map_or(Unit::Slot(base, 1), |(&slot, _)| Unit::Slot(slot, unit)))
        };
        quotients.into_iter().map(unit_of).collect()
    }

    /// The base and the power that the quotient in `slot` divides by; `None` where it is no quotient, or where its
    /// denominator depends on parameters only.
    fn divisor(&self, slot: Slot, powers: &BTreeMap<Slot, Power>) -> Option<Power> {
        let Operation::Div(_, denominator) = self.operations()[slot.index()] else { return None };
        if self.dependence(denominator).is_fixed() {
            return None;
        }
        Some(powers.get(&denominator).copied().unwrap_or((denominator, 1)))
    }

    /// The slots that hold a power of another slot's value: `a^2`, `a^3`, ..., and `a` itself where `a` is the square
    /// root of a slot.
    fn powers(&self) -> BTreeMap<Slot, Power> {
        let mut powers: BTreeMap<Slot, Power> = BTreeMap::new();
        for slot in self.slots() {
            if let Operation::Sqrt(square) = self.operations()[slot.index()] {
                powers.insert(square, (slot, 2));
                powers.insert(slot, (slot, 1));
            }
        }
        for slot in self.slots() {
            let Operation::Mul(a, b) = self.operations()[slot.index()] else { continue };
            let power = |slot: Slot| powers.get(&slot).copied().unwrap_or((slot, 1));
            let ((a, m), (b, n)) = (power(a), power(b));
            if a == b && !powers.contains_key(&slot) {
                powers.insert(slot, (a, m + n));
            }
        }
        powers
    }
}

/// A quotient as the product of its numerator with a reciprocal.
fn times_reciprocal(
    builder: &mut Builder,
    numerator: Slot,
    is_one: bool,
    reciprocal: Slot,
) -> Slot {
    if is_one { reciprocal } else { builder.times(numerator, reciprocal) }
}

fn reciprocal_of(builder: &mut Builder, slot: Slot) -> Slot {
    let one = builder.one();
    builder.push(Operation::Div(one, slot))
}
