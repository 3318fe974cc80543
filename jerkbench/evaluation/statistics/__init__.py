"""From runs to statements: intervals, comparisons, consistency, and what one recording alone can say."""
