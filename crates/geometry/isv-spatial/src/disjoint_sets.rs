//! Union-find.

/// Disjoint sets of the numbers from 0, found with path halving.
#[derive(Clone, Debug)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// Creates a set of its own for each number below `count`.
    #[must_use]
    pub fn new(count: u32) -> Self {
        Self { parent: (0..count).collect() }
    }

    /// Finds the representative of a member's set: its smallest member.
    pub fn find(&mut self, mut member: u32) -> u32 {
        while self.parent[member as usize] != member {
            let grandparent = self.parent[self.parent[member as usize] as usize];
            self.parent[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    /// Joins the sets of two members.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
