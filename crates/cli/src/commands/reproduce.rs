//! `mms reproduce`: the original study, again.

use anyhow::Result;

use crate::arguments::ReproduceOptions;

pub(crate) fn reproduce(_options: &ReproduceOptions) -> Result<bool> {
    anyhow::bail!("not yet")
}
