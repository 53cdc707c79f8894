//! Joints that no motor turns by itself: linkages hold them at a sum of other joints' positions, of which a URDF, whose `<mimic>` names one
//! joint, has no notion.

use super::{
    Urdf,
    element::{Mimic, Term},
};
use body_schema_engine::suggest::did_you_mean;

/// Why a joint cannot follow a sum of others.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {hint}")]
pub struct CouplingError {
    /// What was found.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

fn refused(what: impl Into<String>, hint: impl Into<String>) -> CouplingError {
    CouplingError { what: what.into(), hint: hint.into() }
}

const FORM: &str = "write it as `-(shoulder + elbow)` or `0.5*motor - shoulder`";

impl Urdf {
    /// Lets `joint` follow others: θ = Σ factor · θₖ, rad or m. `sum` is made of names of joints, `+`, `-`, factors with `*`, and
    /// parentheses. The joint has no reading of its own then, as one that mimics another.
    ///
    /// # Errors
    ///
    /// [`CouplingError`] if there is no such joint, it is fixed or mimics another already, or `sum` cannot be read, is 0, or names joints
    /// that do not move or the joint itself.
    pub fn couple(&mut self, joint: &str, sum: &str) -> Result<(), CouplingError> {
        let names: Vec<String> = self.joints.iter().map(|joint| joint.name.clone()).collect();
        let index = names.iter().position(|name| name == joint).ok_or_else(|| unknown(joint, &names))?;
        let mut terms = Sum { text: sum, rest: sum, names: &names, depth: 0 }.read()?;
        terms.retain(|(_, factor)| *factor != 0.0);
        if terms.is_empty() {
            return Err(refused(format!("`{sum}` is always 0"), "a joint that does not move is `fixed` in the URDF"));
        }
        let moves = |index: usize| self.joints[index].body.as_ref().is_ok_and(|body| body.kind.moves().is_some());
        for index in std::iter::once(index).chain(terms.iter().map(|(index, _)| *index)) {
            if !moves(index) {
                return Err(refused(format!("joint `{}` does not move", names[index]), "name joints that move"));
            }
        }
        if terms.iter().any(|(term, _)| *term == index) {
            return Err(refused(format!("joint `{joint}` follows itself"), "name the other joints that hold it"));
        }
        let at = self.joints[index].at;
        let Ok(body) = self.joints[index].body.as_mut() else { return Ok(()) };
        if let Some(Mimic { terms, .. }) = &body.mimic {
            let others: Vec<&str> = terms.iter().map(|term| term.joint.as_str()).collect();
            let what = format!("joint `{joint}` follows `{}` already", others.join("`, `"));
            return Err(refused(what, "let it follow one sum: remove its <mimic> from the URDF, or name it once here"));
        }
        let terms = terms.into_iter().map(|(index, multiplier)| Term { joint: names[index].clone(), multiplier });
        body.mimic = Some(Mimic { terms: terms.collect(), offset: 0.0, at });
        Ok(())
    }
}

fn unknown(name: &str, names: &[String]) -> CouplingError {
    let known = || names.iter().map(String::as_str);
    let hint = did_you_mean(name, known(), || format!("its joints are {}", names.join(", ")));
    refused(format!("the URDF has no joint `{name}`"), hint)
}

/// A sum that is being read.
struct Sum<'a> {
    text: &'a str,
    rest: &'a str,
    /// The names of joints, which may hold any character.
    names: &'a [String],
    depth: usize,
}

/// The factor of each joint, by index; each joint once.
type Factors = Vec<(usize, f64)>;

impl Sum<'_> {
    /// Deeper parentheses are no linkage.
    const DEEPEST: usize = 20;

    fn read(mut self) -> Result<Factors, CouplingError> {
        let factors = self.sum()?;
        if self.rest.trim_start().is_empty() { Ok(factors) } else { Err(self.unreadable()) }
    }

    fn unreadable(&self) -> CouplingError {
        let rest = self.rest.trim();
        let what = if rest.is_empty() {
            format!("`{}` ends too early", self.text)
        } else {
            format!("`{}` cannot be read at `{rest}`", self.text)
        };
        refused(what, FORM)
    }

    /// Takes one of these characters, if it is next.
    fn take(&mut self, wanted: &[char]) -> Option<char> {
        let rest = self.rest.trim_start();
        let next = rest.chars().next().filter(|next| wanted.contains(next))?;
        self.rest = &rest[next.len_utf8()..];
        Some(next)
    }

    fn sign(&mut self) -> Option<f64> {
        // As keyboards and as printed formulas have it.
        self.take(&['+', '-', '−']).map(|sign| if sign == '+' { 1.0 } else { -1.0 })
    }

    fn sum(&mut self) -> Result<Factors, CouplingError> {
        let mut sign = self.sign().unwrap_or(1.0);
        let mut all = Factors::new();
        loop {
            for (joint, factor) in self.product()? {
                match all.iter_mut().find(|(known, _)| *known == joint) {
                    Some((_, known)) => *known += sign * factor,
                    None => all.push((joint, sign * factor)),
                }
            }
            match self.sign() {
                Some(next) => sign = next,
                None => return Ok(all),
            }
        }
    }

    /// A number, `*` and a sum in parentheses or a joint, in either order, the number left out where it is 1.
    fn product(&mut self) -> Result<Factors, CouplingError> {
        let mut factor = 1.0;
        if let Some(number) = self.number() {
            factor = number;
            self.take(&['*', '·']).ok_or_else(|| self.unreadable())?;
        }
        let factors = self.primary()?;
        if self.take(&['*', '·']).is_some() {
            factor *= self.number().ok_or_else(|| self.unreadable())?;
        }
        Ok(factors.into_iter().map(|(joint, one)| (joint, factor * one)).collect())
    }

    fn primary(&mut self) -> Result<Factors, CouplingError> {
        if self.take(&['(']).is_some() {
            self.depth += 1;
            let factors = if self.depth <= Self::DEEPEST { self.sum()? } else { return Err(self.unreadable()) };
            self.depth -= 1;
            return self.take(&[')']).map(|_| factors).ok_or_else(|| self.unreadable());
        }
        let rest = self.rest.trim_start();
        let joint = self.joint(rest);
        if let Some(joint) = joint {
            self.rest = &rest[self.names[joint].len()..];
            return Ok(vec![(joint, 1.0)]);
        }
        let word = rest.split(|c: char| c.is_whitespace() || "+-−*·()".contains(c)).next().unwrap_or_default();
        Err(if word.is_empty() { self.unreadable() } else { unknown(word, self.names) })
    }

    /// The joint with the longest name that stands here as a whole word.
    fn joint(&self, rest: &str) -> Option<usize> {
        let ends = |name: &String| {
            rest.strip_prefix(name.as_str())
                .is_some_and(|behind| !behind.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        };
        let here = (0..self.names.len()).filter(|joint| !self.names[*joint].is_empty() && ends(&self.names[*joint]));
        here.max_by_key(|joint| self.names[*joint].len())
    }

    /// A number that is no joint's name.
    fn number(&mut self) -> Option<f64> {
        let rest = self.rest.trim_start();
        if self.joint(rest).is_some() {
            return None;
        }
        let end = rest.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(rest.len());
        let number = rest[..end].parse().ok().filter(|number: &f64| number.is_finite())?;
        self.rest = &rest[end..];
        Some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> Urdf {
        let joint = |name: &str, parent: usize, kind: &str| {
            format!(
                "<joint name=\"{name}\" type=\"{kind}\"><origin xyz=\"0.{parent} 0 0\"/><parent link=\"l{parent}\"/><child \
                 link=\"l{}\"/><axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\"/></joint>",
                parent + 1
            )
        };
        let links: String = (0..6).map(|link| format!("<link name=\"l{link}\"/>")).collect();
        let names =
            [("q", "continuous"), ("q2", "revolute"), ("q-3", "revolute"), ("tilt", "revolute"), ("end", "fixed")];
        let joints: String = names.iter().enumerate().map(|(at, (name, kind))| joint(name, at, kind)).collect();
        Urdf::parse(&format!("<robot name=\"r\">{links}{joints}</robot>")).unwrap()
    }

    #[test]
    fn a_sum_of_readings_moves_the_joint() {
        let sums: [(&str, [f64; 3]); 7] = [
            ("-(q2 + q-3)", [0.0, -1.0, -1.0]),
            ("−q2−q-3", [0.0, -1.0, -1.0]),
            ("q-3 - q2", [0.0, -1.0, 1.0]),
            ("0.5*q + q2*2", [0.5, 2.0, 0.0]),
            ("q2 - 2*(q-3 - (q2 - q))", [-2.0, 3.0, -2.0]),
            ("q2+q2", [0.0, 2.0, 0.0]),
            (" + q ", [1.0, 0.0, 0.0]),
        ];
        for (sum, factors) in sums {
            let mut urdf = robot();
            urdf.couple("tilt", sum).unwrap_or_else(|error| panic!("{sum}: {error}"));
            let chain = urdf.chain("l0", "l5").unwrap();
            let names: Vec<&str> = chain.readings.iter().map(|reading| reading.name.as_str()).collect();
            assert_eq!(names, ["q", "q2", "q-3"]);
            let readings = [0.3, -0.7, 1.1];
            let expected: f64 = factors.iter().zip(readings).map(|(factor, reading)| factor * reading).sum();
            let positions = chain.positions(&readings);
            assert_eq!(positions[..3], readings);
            assert!((positions[3] - expected).abs() < 1e-15, "{sum}: {} is not {expected}", positions[3]);
        }
    }

    #[test]
    fn one_coupled_joint_may_follow_another() {
        let mut urdf = robot();
        urdf.couple("q-3", "-q2").unwrap();
        urdf.couple("tilt", "q-3 - q").unwrap();
        let chain = urdf.chain("l0", "l4").unwrap();
        assert_eq!(chain.positions(&[0.5, 0.25]), [0.5, 0.25, -0.25, -0.75]);
        // In a circle nothing moves them.
        let mut urdf = robot();
        urdf.couple("q-3", "tilt").unwrap();
        urdf.couple("tilt", "q-3 - q").unwrap();
        let refused = urdf.chain("l0", "l4").unwrap_err();
        assert!(refused.what.contains("which nothing moves"), "{refused}");
    }

    #[test]
    fn what_is_no_sum_is_refused() {
        let wrong = [
            ("tilt", "", "ends too early"),
            ("tilt", "q2 +", "ends too early"),
            ("tilt", "(q2", "ends too early"),
            ("tilt", "q2 q", "cannot be read at `q`"),
            ("tilt", "q2)", "cannot be read at `)`"),
            ("tilt", "2", "ends too early"),
            ("tilt", "2 q2", "cannot be read at `q2`"),
            ("tilt", "elbow", "no joint `elbow`"),
            ("tilt", "q2x", "no joint `q2x`"),
            ("tilt", "q2 - q2", "always 0"),
            ("tilt", "0*q2", "always 0"),
            ("tilt", "end", "`end` does not move"),
            ("tilt", "tilt + q", "follows itself"),
            ("end", "q", "`end` does not move"),
            ("titl", "q", "no joint `titl`"),
        ];
        for (joint, sum, says) in wrong {
            let refused = robot().couple(joint, sum).expect_err(sum);
            assert!(refused.what.contains(says), "{sum}: {refused}");
        }
        let deep = format!("{}q{}", "(".repeat(100_000), ")".repeat(100_000));
        assert!(robot().couple("tilt", &deep).is_err());
        let mut twice = robot();
        twice.couple("tilt", "q").unwrap();
        assert!(twice.couple("tilt", "q2").unwrap_err().what.contains("follows `q` already"));
    }
}
