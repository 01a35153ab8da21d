use std::str::FromStr;

/// One of several shares of a run's photons, each traced by a machine of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Shard {
    /// Which share, from 1.
    pub index: u32,
    /// Of how many.
    pub of: u32,
}

impl Shard {
    /// Shares at most: as many as units of work that are worth a machine.
    pub const MOST: u32 = 10_000;

    /// The name of its folder: `I-of-N`.
    pub fn name(self) -> String {
        format!("{}-of-{}", self.index, self.of)
    }

    /// The share of a folder's name.
    pub fn of_name(name: &str) -> Option<Self> {
        let (index, of) = name.split_once("-of-")?;
        Self::checked(index, of).filter(|shard| shard.name() == name)
    }

    /// Whether a unit of work belongs to it; units go round.
    pub fn has(self, unit: u64) -> bool {
        unit % u64::from(self.of) == u64::from(self.index) - 1
    }

    fn checked(index: &str, of: &str) -> Option<Self> {
        let (index, of) = (index.parse().ok()?, of.parse().ok()?);
        (1..=of).contains(&index).then_some(Self { index, of }).filter(|s| s.of <= Self::MOST)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once('/').and_then(|(index, of)| Self::checked(index, of)).ok_or_else(|| {
            format!("expected I/N with I from 1 to N and N up to {}, found `{text}`", Self::MOST)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_read_and_split_all_units() {
        let shards = ["1/3", "2/3", "3/3"].map(|s| s.parse::<Shard>().expect(s));
        for unit in 0..20 {
            assert_eq!(shards.iter().filter(|s| s.has(unit)).count(), 1);
        }
        for wrong in ["0/3", "4/3", "1", "1/0", "a/b", "-1/2", "1/99999", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        assert_eq!(Shard::of_name("2-of-3"), Some(shards[1]));
        assert_eq!(Shard::of_name("02-of-3"), None);
    }
}
