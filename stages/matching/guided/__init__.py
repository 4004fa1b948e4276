"""The guided cost volume: the descriptor-Net proposes disparities, the matching-Net judges them."""
