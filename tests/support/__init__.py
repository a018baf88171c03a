"""What several tests share: campaigns, fake runs, synthetic results, other solutions."""
