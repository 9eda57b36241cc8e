"""What is proposed to be believed: loops, recognised places, joins, and second thoughts."""
